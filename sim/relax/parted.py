# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference with its lips parted: what a scan with an open mouth is fitted with, so that each lip finds its own.

As eyes are shut before closed eyes are fitted (`adapt.shut_eyes`), jaw and muscles are set so that the landmarks and the
lips' edges are explained; data and landmarks do the rest.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix, vstack

from ..adapt.closest import Surface
from ..adapt.completion import sigma
from ..adapt.thin_plate_spline import similarity
from ..anatomy.head import JAW_PARTS, Head
from ..tissue.jaw import jaw_transform
from .explain import Expression, explain
from .mouth_gap import lip_edges, opening, smoothed
from .people import covariance
from .responses import MOUTH, answers, responses

#: Landmarks that expressions of the mouth leave where they are.
STILL = (
    *"v g op tr n se prn".split(),
    *(f"{name}_{side}" for name in "eu ft t en ex os sa sba pra pa obs obi".split() for side in "lr"),
)
APART = 6.0  # mm between the lips on the scan, and by what all is explained with, from which on they count as parted
TOLD = 3.5
#: mm between the lips on the scan that are known to be apart otherwise, and by what all is explained with. Noise parts closed
#: lips by 2.9; of a tube's 5 mm seven landmarks explained 2.5.
AJAR, LITTLE = 3.0, 1.5
CARE = 0.7  # a landmark's deviation, by what is usual for it
EDGE = 1.0  # mm, the same of a lip's edge
ASIDE = 0.75  # edges nearer to the corners than this share of the way are not looked for
LINES = 31  # from lip to lip, along which they are


@dataclass(frozen=True, eq=False)
class PartedLips:
    """expression : what opens the mouth; rim (k,) vertices of the lips whose place is known, edges (k, 3) mm."""

    expression: Expression
    rim: np.ndarray
    edges: np.ndarray


def parted_lips(reference: Head, target: Surface, given, lips=None) -> PartedLips | None:
    """How the mouth of a scan ``target`` with the landmarks ``given`` (name -> mm) is open; None: its lips are closed.

    lips : name -> (3,) mm, about where their landmarks are, if they are known to be apart, if only a little; None: it is not
        known
    """
    names = [name for name in given if name in reference.landmarks.names and name != "sto"]
    if len(names) < 6 or not answers(reference):
        return None
    rest = reference.landmark_positions()
    marks, goal = (np.array([of[name] for name in names]) for of in (rest, given))
    matrix, _ = similarity(marks, goal)
    forward = -matrix[:, 1] / np.linalg.norm(matrix[:, 1])
    looked, about = np.linspace(-ASIDE, ASIDE, LINES), (lips or {}) | given
    least = AJAR if lips else APART
    # The lower lip of a broad smile hangs below the straight ways to the corners, which end in the gap then.
    edges = lip_edges(target, about, forward, looked)
    if lips and opening(edges, looked) < least:
        edges = lip_edges(target, about, forward, looked, arched=True)
    if opening(edges, looked) < least:
        return None
    pairs, shares = rim_pairs(reference)
    edges = smoothed(edges, looked, shares)
    seen = np.isfinite(edges).all(axis=(1, 2)) & (np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1) > TOLD)
    rim, edges = pairs[seen].T.ravel(), edges[seen].transpose(1, 0, 2).reshape(-1, 3)
    expression = explained(reference, names, marks, goal, rim, edges)
    middle = pairs[np.abs(shares).argmin()]
    gap = np.diff((reference.skin.vertices + expression.modelled)[middle], axis=0)[0]
    return PartedLips(expression, rim, edges) if np.linalg.norm(gap) > (LITTLE if lips else TOLD) else None


def rim_pairs(reference: Head):
    """(k, 2) vertices of upper and lower lip that meet on the rims, and (k,) how far toward the left corner they lie."""
    from ..adapt.openings import lip_pairs, rims

    pairs = lip_pairs(reference, rims(reference))
    middle = reference.skin.vertices[pairs].mean(axis=1)
    rest = reference.landmark_positions()
    start = (rest["ch_l"] + rest["ch_r"]) / 2
    half = (rest["ch_l"] - rest["ch_r"]) / 2
    shares = (middle - start) @ half / (half @ half)
    keep = np.abs(shares) < ASIDE
    return pairs[keep], shares[keep]


def explained(reference: Head, names, marks, goal, rim, edges) -> Expression:
    """The expression of a face of which landmarks and lips are known.

    names, marks (k, 3) mm on the reference, goal (k, 3) mm on the face; rim (r,) vertices of the lips, edges (r, 3) mm
    """
    from ..adapt.skin_fit import landmark_rows

    vertices = reference.skin.vertices
    n = len(vertices)
    deviation = np.concatenate([CARE * np.array([sigma(name) for name in names]), np.full(len(rim), EDGE)])
    still = np.concatenate([np.isin(names, STILL), np.zeros(len(rim), dtype=bool)]) / deviation**2
    if np.count_nonzero(still) < 4:
        still[: len(names)] = 1 / deviation[: len(names)] ** 2
    points = np.concatenate([marks, vertices[rim]])
    places = np.concatenate([goal, edges])
    matrix, shift = similarity(points, places, still)
    offsets = (places - shift) @ np.linalg.inv(matrix).T - points
    on_rim = csr_matrix((np.ones(len(rim)), (np.arange(len(rim)), rim)), shape=(len(rim), n))
    rows = vstack([landmark_rows(reference.landmarks, names, n), on_rim]).tocsr()
    people = covariance(reference.landmark_positions(), points, still)
    mouth = tuple(f"{name}{side}" for name in MOUTH for side in ("", "_l", "_r"))
    return explain(responses(), vertices, reference.jaw, rows, offsets, people, deviation, mouth)


def with_parted_lips(reference: Head, expression: Expression) -> Head:
    """``reference`` with the skin as ``expression`` moves it, and what hangs on the jaw with it."""
    rotation, shift = jaw_transform(reference.jaw, min(expression.jaw, 1.0))
    parts = {name: reference.parts[name].vertices @ rotation.T + shift for name in JAW_PARTS}
    moved = reference.with_vertices({**parts, "skin": reference.skin.vertices + expression.modelled})
    return replace(moved, jaw=replace(reference.jaw, incisor=rotation @ reference.jaw.incisor + shift))
