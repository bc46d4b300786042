# SPDX-License-Identifier: GPL-3.0-or-later
"""The neutral skin of a person whose scan smiles, squints or has the mouth open.

Lee, Terzopoulos and Waters 1995, section 2.3, put the lips of the closed mouth in place of the open one's and keep the
range of the data. Here the whole expression is taken away: what jaw and muscles do on the reference (`responses`)
explains how the face differs from neutral people (`explain`); that is subtracted, and the lips are laid on each other.
All else stays as scanned, down to its detail.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from ..adapt.refine import scattered
from ..adapt.rest import rest_of
from ..adapt.thin_plate_spline import similarity
from ..anatomy.head import Head
from ..mesh_subdivision import drawn
from .close_lips import lips_closed
from .explain import explain
from .parted import answers
from .people import covariance
from .responses import responses

#: Skin that the muscles and jaw move by less holds the face in place, mm.
UNMOVED = 0.25
#: Points that are looked at: mm between them where an expression moves them by more than `BUSY` mm, and elsewhere.
FINE, COARSE, BUSY = 9.0, 20.0, 2.0
INVENTED = 4.0  # mm by which skin without data may be wrong
TAKEN = 0.3  # mm by which skin with data may be
NAMED = 3  # muscles that a report names


@dataclass(frozen=True, eq=False)
class Relaxed:
    """skin (n, 3) mm, the neutral cage; report : what was done, for people to read."""

    skin: np.ndarray
    report: dict


def relaxed(reference: Head, skin, fitted, unseen=None) -> Relaxed:
    """The neutral skin of a person.

    Parameters
    ----------
    reference : the head whose skin was fitted, with its lips closed
    skin (n, 3) mm : the cage of the skin as scanned
    fitted (n,) : 0..1, how far data decided a vertex
    unseen (n,) bool : vertices that are to be left out (None: none)
    """
    if not answers(reference):
        raise ValueError("the table of responses belongs to another reference head")
    rest, table = rest_of(reference), responses()
    start = drawn(reference.skin.faces, reference.skin.vertices)
    now = drawn(reference.skin.faces, skin)
    rows = sampled(rest, start, table.reach, unseen)
    trust = np.asarray(fitted, dtype=float)[rows]
    neck = np.asarray(reference.groups["neck"])[rows] > 0.2
    still = (table.reach[rows] < UNMOVED) & ~neck
    still = still * (trust + 0.02)
    matrix, shift = similarity(start[rows], now[rows], still)
    offsets = (now[rows] - shift) @ np.linalg.inv(matrix).T - start[rows]
    people = covariance(reference.landmark_positions(), start[rows], still)
    n = len(skin)
    sampling = csr_matrix((np.ones(len(rows)), (np.arange(len(rows)), rows)), shape=(len(rows), n))
    noise = TAKEN + (INVENTED - TAKEN) * (1 - np.clip(2 * trust, 0, 1))
    noise[rest.rim[rows]] = np.maximum(noise[rest.rim[rows]], 1.0)
    found = explain(table, start, sampling, offsets, people, noise=noise)
    out = skin - found.displacement @ matrix.T
    gap = lip_gap(rest, skin)
    out = lips_closed(rest, out, matrix)
    moved = np.linalg.norm(out - skin, axis=1)[~rest.inner]
    strongest = sorted(found.muscles, key=lambda name: (-found.muscles[name], name))
    report = {
        "jaw_degrees": float(np.degrees(found.jaw * reference.jaw.open_max)),
        "muscles": {name: round(found.muscles[name], 3) for name in strongest if found.muscles[name] >= 0.05},
        "lips_apart_mm": gap,
        "moved_max_mm": float(moved.max()),
    }
    return Relaxed(out, report)


def lip_gap(rest, skin) -> float:
    """mm between the lips in the middle of the mouth of a skin (n, 3)."""
    pairs = rest.lip_pairs
    middle = np.abs(rest.head.skin.vertices[pairs].mean(axis=1)[:, 0]) < 6
    return float(np.median(np.linalg.norm(skin[pairs[middle, 0]] - skin[pairs[middle, 1]], axis=1)))


def sampled(rest, points, reach, unseen=None) -> np.ndarray:
    """Indices (k,) of seen skin, close together where expressions move it."""
    seen = ~rest.inner
    if unseen is not None:
        seen &= ~unseen
    busy, calm = np.flatnonzero(seen & (reach > BUSY)), np.flatnonzero(seen & (reach <= BUSY))
    picked = np.concatenate([busy[scattered(points[busy], FINE)], calm[scattered(points[calm], COARSE)]])
    return np.unique(np.concatenate([picked, rest.lip_rim]))
