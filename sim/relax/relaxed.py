# SPDX-License-Identifier: GPL-3.0-or-later
"""The neutral skin of a person whose scan smiles, squints or has the mouth open.

Lee, Terzopoulos and Waters 1995, section 2.3, put the lips of the closed mouth in place of the open one's and keep the
range of the data. Here the whole expression is taken away: what jaw and muscles do on the reference (`responses`)
explains how the face differs from neutral people (`explain`): as a smile, by what is known of smiles (`smile`), as a mouth
that just opens, or as anything, whichever explains it best. It is subtracted, and the lips are laid on each other. All else
stays as scanned, down to its detail.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, vstack

from ..adapt.refine import scattered
from ..adapt.rest import rest_of
from ..adapt.skin_fit import landmark_rows
from ..adapt.thin_plate_spline import similarity
from ..anatomy.head import Head
from ..mesh_subdivision import smoother
from .close_lips import corners_smoothed, lips_closed, lips_rounded
from .explain import explain
from .people import covariance
from .responses import answers, responses
from .smile import lifted, told_of_jaw, told_of_smile
from .upper_teeth import TOLD, told_of_stomion

#: Skin that the muscles and jaw move by less holds the face in place, mm; of it, points this far apart are looked at.
UNMOVED, COARSE = 0.25, 30.0
ROUND = 16.0  # mm between the points that are looked at on the cheeks
NOISE = 1.5  # mm by which a landmark may be wrong, along each axis
#: The same of the edges of the lips front to back: of a lip that hangs over the other, a scan shows the front of its edge and
#: not where the other one meets it. That was taken for muscles that purse the lips, and with them went the person's own.
DEPTH = 4.0
UNSURE = 0.02  # trust in skin without data, of 1
#: Squares of deviations that a smile may cost more than a mouth that just opens, and that more than anything that muscles
#: do. Of 42 scans of eleven people of ICT-FaceKit with open mouths 10 of 11 smiles cost at most 1.2 more; mouths that just
#: open, or whose corners are drawn aside or lower lip down, cost up to .8 more than anything, and of our own people with full
#: lips up to 4.0; pursed ones 4.8 and more but for two weak ones, disgust 1.7 to 9. Nor does a face smile whose corners are
#: hardly lifted: those of 32 neutral ones by up to .26 of a smile's lift, but by .15 where a smile costs as little, and of two
#: smiles of .3 and .4 by .1.
SMILES, OPENS, LIFTED = 2.0, 4.2, 0.2
#: Muscles that press the lips or pull them down: a person's own chin looks too much like what they do. So do full lips like
#: pursed ones, the upper one at least: those of the lower lip contract by .2 or more on 6 scans of pursed lips, and by up to
#: .08 on 38 others, of which two were hardly pursed.
CHIN = ("mentalis", "platysma", "depressor_anguli_oris")
PURSING = ("orbicularis_oris", "incisivus")
LOWER_LIP, PURSED = ("orbicularis_oris_lower", "incisivus_labii_inferioris"), 0.15
#: Landmarks that no expression moves much and that hair may hide; the middle of the mouth lies on no lip.
LEFT_OUT = ("sto", "v", "op", "tr", *(f"{m}_{s}" for m in "go sa sba pra pa obs obi".split() for s in "lr"))


@dataclass(frozen=True, eq=False)
class Relaxed:
    """skin (n, 3) mm, the neutral cage; jaw : how far it was open, 0..1; report : what was done, for people to read
    (``smile``: how far the face seems to smile, of what smiles lift the corners of the mouth)."""

    skin: np.ndarray
    jaw: float
    report: dict


def relaxed(reference: Head, skin, fitted, unseen=None, teeth=()) -> Relaxed:
    """The neutral skin of a person.

    Parameters
    ----------
    reference : the head whose skin was fitted, with its lips closed
    skin (n, 3) mm : the cage of the skin as scanned
    fitted (n,) : 0..1, how far data decided a vertex
    unseen (n,) bool : vertices that are to be left out (None: none)
    teeth (k, 3) mm : the edge of the upper incisors, where it is seen
    """
    if not answers(reference):
        raise ValueError("the table of responses belongs to another reference head")
    rest, table = rest_of(reference), responses()
    n = len(skin)
    as_drawn = smoother(reference.skin.faces, n)[0][:n]
    start, now = (as_drawn @ cage for cage in (reference.skin.vertices, skin))
    far = unmoved(rest, start, table.reach, unseen)
    still = np.asarray(fitted, dtype=float)[far] + UNSURE
    matrix, shift = similarity(start[far], now[far], still)
    names = [name for name in reference.landmarks.names if name not in LEFT_OUT]
    lips = rest.lip_rim[::2]
    rim = np.concatenate([lips, cheeks(rest, start)])
    on_rim = csr_matrix((np.ones(len(rim)), (np.arange(len(rim)), rim)), shape=(len(rim), n))
    sampling = vstack([landmark_rows(reference.landmarks, names, n), on_rim])
    back = np.linalg.inv(matrix).T
    offsets = (sampling @ now - shift) @ back - sampling @ start
    noise = np.full(offsets.shape, NOISE)
    noise[len(names) : len(names) + len(lips), 1] = DEPTH
    meet = told_of_stomion(reference, (np.reshape(teeth, (-1, 3)) - shift) @ back)
    if meet is not None:
        sampling = vstack([sampling, landmark_rows(reference.landmarks, ["sto"], n)])
        offsets, noise = np.concatenate([offsets, meet[None]]), np.concatenate([noise, [TOLD]])
    known = np.arange(len(offsets)) >= len(names) + len(rim)
    points = np.concatenate([sampling @ start, start[far]])
    weights = np.concatenate([np.zeros(len(offsets)), still])
    people = covariance(reference.landmark_positions(), points, weights)
    people = people[: offsets.size, : offsets.size]
    muscles, plain = ([name for name in table.names if not name.startswith(left)] for left in (CHIN, (*CHIN, *PURSING)))
    cage, rows = reference.skin.vertices, (sampling @ as_drawn).tocsr()
    upper = rest.seen_pairs[:, 0]
    lip = upper[np.abs(cage[upper, 0]).argmin()]
    about = (table, cage, reference.jaw, rows, offsets, people, noise)
    found = explain(*about, muscles, known)
    if max(found.muscles[name] for name in muscles if name.startswith(LOWER_LIP)) < PURSED:
        found = explain(*about, plain, known)
    told = told_of_smile(reference, table, as_drawn, lip, found.jaw)
    lifts = lifted(told, table, found)
    opens = explain(*about, plain, known, told_of_jaw(told, table, found.jaw))
    told = told_of_smile(reference, table, as_drawn, lip, found.jaw, lifts)
    smile = explain(*about, plain, known, told)
    smiling = bool(lifts.mean() > LIFTED and smile.cost < opens.cost + SMILES)
    if smiling:
        found = smile
    elif opens.cost < found.cost + OPENS:
        found = opens
    out = skin - found.displacement @ matrix.T
    for smoothing in (lips_closed, lips_rounded, corners_smoothed):
        out = smoothing(rest, out, matrix)
    moved = np.linalg.norm(out - skin, axis=1)[~rest.inner]
    strongest = sorted(found.muscles, key=lambda name: (-found.muscles[name], name))
    report = {
        "jaw_degrees": float(np.degrees(found.jaw * reference.jaw.open_max)),
        "smiles": smiling,
        "smile": round(float(lifts.mean()), 3),
        "muscles": {name: round(found.muscles[name], 3) for name in strongest if found.muscles[name] >= 0.05},
        "lips_apart_mm": lip_gap(rest, skin),
        "upper_teeth_seen": meet is not None,
        "moved_max_mm": float(moved.max()),
    }
    return Relaxed(out, found.jaw, report)


def lip_gap(rest, skin) -> float:
    """mm between the lips in the middle of the mouth of a skin (n, 3)."""
    pairs = rest.lip_pairs
    middle = np.abs(rest.head.skin.vertices[pairs].mean(axis=1)[:, 0]) < 6
    return float(np.median(np.linalg.norm(skin[pairs[middle, 0]] - skin[pairs[middle, 1]], axis=1)))


def unmoved(rest, points, reach, unseen=None) -> np.ndarray:
    """Indices (k,) of seen skin of the head, evenly apart, that no expression moves."""
    still = ~rest.inner & (reach < UNMOVED) & (np.asarray(rest.head.groups["neck"]) < 0.2)
    if unseen is not None:
        still &= ~unseen
    rows = np.flatnonzero(still)
    return rows[scattered(points[rows], COARSE)]


def cheeks(rest, points) -> np.ndarray:
    """Indices (k,) of the cheeks' skin, evenly apart: no landmark tells of it."""
    cheek = np.maximum(rest.head.groups["cheek_l"], rest.head.groups["cheek_r"]) > 0.5
    rows = np.flatnonzero(cheek & ~rest.inner)
    return rows[scattered(points[rows], ROUND)]
