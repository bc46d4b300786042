# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a face is in a scan that may be turned any way: the reference face laid on it from all sides at once.

Starts are spread evenly over the group of rotations (Alexa 2022, super-Fibonacci spirals) and over a few places; each
descends by trimmed closest points (Besl and McKay 1992), and the hopeless ones are dropped on the way.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..progress import Progress, Work
from ..scan.face_match import COARSE, FINE, align, in_order, starts_of, thinned
from ..scan.orientation import rotations

LOOKING = "Looking for the face"
STARTS = 240
FEW = 70  # points of the template in the first rounds
SURVIVORS = 50  # starts that go on after the first rounds
SAME = 0.35  # rad: placements turned by less are one


@dataclass(frozen=True, eq=False)
class Pose:
    """A similarity ``x -> scale turn x + shift`` from the reference's place to the scan's, mm.

    misfit : trimmed mean distance in mm, on a head of reference size
    """

    scale: float
    turn: np.ndarray
    shift: np.ndarray
    misfit: float


def even_rotations(count: int) -> np.ndarray:
    """(count, 3, 3) rotations, spread evenly (Alexa 2022, algorithm 1)."""
    s = np.arange(count) + 0.5
    r, big = np.sqrt(s / count), np.sqrt(1 - s / count)
    alpha, beta = 2 * np.pi * s / np.sqrt(2.0), 2 * np.pi * s / 1.533751168755204288118041
    x, y, z, w = r * np.sin(alpha), r * np.cos(alpha), big * np.sin(beta), big * np.cos(beta)
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=1),
            np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=1),
            np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=1),
        ],
        axis=1,
    )


def search_poses(points, template, count: int = 5, starts: int = STARTS, survivors: int = SURVIVORS) -> Work:
    """Work returning the ``count`` best placements of the face that differ by more than a little turn, best first.

    points (n, 3) mm : samples of the scan's surface, in any turn
    template (k, 3) mm : the reference's face, the tip of the nose first (`face_match.face_template`)
    starts, survivors : turns to begin with, and how many placements go on after the first rounds
    """
    fine = cKDTree(thinned(points, FINE))
    coarse = thinned(points, COARSE)
    tree = cKDTree(coarse)
    few = template[in_order(template, FEW)]
    turns = [*rotations(), *even_rotations(starts)]
    turn, shift, _ = starts_of(coarse, template, few, turns)
    yield Progress(0.2, LOOKING)
    scale, turn, shift, misfit = align(tree, few, turn, shift, rounds=4)
    yield Progress(0.6, LOOKING)
    best = np.argsort(misfit, kind="stable")[:survivors]
    scale, turn, shift, misfit = align(tree, few, turn[best], shift[best], 10, scale[best])
    yield Progress(0.8, LOOKING)
    kept = _different(turn, misfit, max(3 * count, survivors // 4))
    scale, turn, shift, misfit = align(fine, template, turn[kept], shift[kept], 10, scale[kept])
    return [Pose(float(scale[k]), turn[k], shift[k], float(misfit[k])) for k in _different(turn, misfit, count)]


def _different(turn, misfit, count):
    """Indices of the best placements, no two of them turned alike."""
    kept = []
    for k in np.argsort(misfit, kind="stable"):
        angles = [np.arccos(np.clip((np.trace(turn[j].T @ turn[k]) - 1) / 2, -1, 1)) for j in kept]
        if not angles or min(angles) > SAME:
            kept.append(int(k))
        if len(kept) == count:
            break
    return np.array(kept)
