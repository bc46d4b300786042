# SPDX-License-Identifier: GPL-3.0-or-later
"""Lips laid on each other exactly, and what surrounds them smoothly after; no folds of an expression beside the mouth."""

import numpy as np
from scipy.sparse import coo_matrix, diags
from scipy.spatial import cKDTree

from ..adapt.rest import Rest
from ..adapt.skin_fit import landmark_rows
from ..adapt.smooth_system import factorised

#: Skin within the first distance of the lips, mm, gives way freely, beyond the second it hardly does.
NEAR, FAR = 10.0, 32.0
HOLD = 1.0  # pull toward where it was, of skin that hardly gives way
MEET = 200.0  # pull of a pair of points on each other
#: Pull of lips toward where they were, as they get the reference's roundness back, and of skin this far from where they
#: meet, mm: the scan shows how high the red is, but not the roundness of what was stretched.
KEEP, KEPT, BEYOND = 0.003, 30.0, 9.0
FOLDS = 22.0  # mm about a corner of the mouth in which folds are the expression's, farther off less and less of them
HELD = 10.0  # pull of a point that stays on where it was
CORNERS = ("ch_l", "ch_r")


def lips_closed(rest: Rest, skin, matrix) -> np.ndarray:
    """Skin (n, 3) mm with each pair of lip points as far above each other as on the reference.

    matrix (3, 3) turns and scales the reference into the skin's place. The displacement is the one of least bending, straight
    up and down: lips of which one hangs over the other stay so.
    """
    start = rest.head.skin.vertices
    apart, want = pairs_apart(rest, matrix)
    away = cKDTree(start[rest.lip_rim]).query(start)[0]
    hold = 1e-4 + HOLD * np.clip((away - NEAR) / (FAR - NEAR), 0, 1) ** 2
    system = rest.energy + diags(hold) + MEET * (apart.T @ apart)
    up = matrix[:, 2] / np.linalg.norm(matrix[:, 2])
    raised = factorised(system)(MEET * (apart.T @ ((want - apart @ skin) @ up)))
    return skin + np.outer(raised, up)


def lips_rounded(rest: Rest, skin, matrix) -> np.ndarray:
    """Skin (n, 3) mm whose lips differ as smoothly from the reference's as can be: a stretched lip swells again.

    matrix (3, 3) as in `lips_closed`; the lips come to meet where the one is that lies farther back, under the other.
    """
    start = rest.head.skin.vertices
    away = cKDTree(start[rest.lip_pairs.ravel()]).query(start)[0]
    depth = ((skin - start @ matrix.T) @ matrix[:, 1])[rest.seen_pairs]
    behind = np.take_along_axis(rest.seen_pairs, depth.argmax(axis=1)[:, None], axis=1)[:, 0]
    held = coo_matrix((np.ones(len(behind)), (np.arange(len(behind)), behind)), shape=(len(behind), len(start))).tocsr()
    return smoothest(rest, skin, matrix, away / BEYOND, held)


def corners_smoothed(rest: Rest, skin, matrix) -> np.ndarray:
    """Skin (n, 3) mm that beside the corners of the mouth differs as smoothly from the reference's as can be.

    What a smile folds there, and an open mouth stretches, is no part of the neutral face, and no model of muscles is as fine as
    to take it away. matrix (3, 3) as in `lips_closed`; lips keep meeting and corners stay where they are.
    """
    start = rest.head.skin.vertices
    corners = landmark_rows(rest.head.landmarks, CORNERS, len(start))
    away = cKDTree(corners @ start).query(start)[0]
    return smoothest(rest, skin, matrix, away / FOLDS, corners)


def smoothest(rest: Rest, skin, matrix, away, held=None) -> np.ndarray:
    """Skin (n, 3) mm that differs as smoothly from the reference's as can be where it is free to; its lips meet.

    matrix (3, 3) as in `lips_closed`; away (n,) : 0 where the skin is free, 1 and more where it stays; held (k, n) sparse :
    rows that give points which stay anyway
    """
    base = rest.head.skin.vertices @ matrix.T
    apart, want = pairs_apart(rest, matrix)
    keep = KEEP * (KEPT / KEEP) ** np.clip(away, 0, 1)
    system = rest.energy + diags(keep) + MEET * (apart.T @ apart)
    right = keep[:, None] * (skin - base) + MEET * (apart.T @ (want - apart @ base))
    if held is not None:
        system = system + HELD * (held.T @ held)
        right += HELD * (held.T @ (held @ (skin - base)))
    return base + factorised(system)(right)


def pairs_apart(rest: Rest, matrix):
    """Sparse rows (k, n) that give the offsets between the lips' pairs, and (k, 3) mm what those are to be."""
    upper, lower = rest.lip_pairs.T
    start = rest.head.skin.vertices
    k = len(upper)
    place = (np.tile(np.arange(k), 2), np.concatenate([upper, lower]))
    apart = coo_matrix((np.repeat([1.0, -1.0], k), place), shape=(k, len(start))).tocsr()
    return apart, (start[upper] - start[lower]) @ matrix.T
