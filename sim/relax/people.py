# SPDX-License-Identifier: GPL-3.0-or-later
"""How neutral people differ from the reference: the covariance of points on their skin.

It is that of our own random individuals, whose measurements are drawn from published norms (`sim.scan.individual`),
and of smooth differences that no norm tells of, laid on the reference by what expressions do not move.
"""

import numpy as np
from scipy.spatial.distance import cdist

from ..scan.individual import variation

#: Differences beyond the norms: reach in mm, deviation in mm along each axis. Neutral faces alone would have about half of
#: that; with more, less of a person is taken for an expression that our muscles do not have.
BEYOND = ((45.0, 3.0), (18.0, 2.0))


def covariance(landmarks, points, still) -> np.ndarray:
    """(3 k, 3 k) mm² of the displacements of neutral people's ``points`` (k, 3) mm from the reference's.

    landmarks : the reference's, name -> (3,) mm
    still : (k,) weights of the points by which people are laid on the reference, by a similarity
    """
    apart = cdist(points, points, "sqeuclidean")
    more = sum(deviation**2 * np.exp(-apart / (2 * reach**2)) for reach, deviation in BEYOND)
    free = left_by_similarity(points, still)
    normed = variation(landmarks, points).reshape(3 * len(points), -1)
    return free @ (normed @ normed.T + np.kron(more, np.eye(3))) @ free.T


def left_by_similarity(points, weights) -> np.ndarray:
    """(3 k, 3 k): what small displacements of ``points`` (k, 3) are once the points are laid back by the similarity that
    fits best, with ``weights`` (k,)."""
    count = len(points)
    x = points - np.average(points, axis=0, weights=weights)
    moves = np.zeros((count, 3, 7))
    moves[:, :, :3] = np.eye(3)
    for axis in range(3):
        moves[:, :, 3 + axis] = np.cross(np.eye(3)[axis], x)
    moves[:, :, 6] = x
    moves = moves.reshape(3 * count, 7)
    held = moves * np.repeat(weights, 3)[:, None]
    return np.eye(3 * count) - moves @ np.linalg.solve(held.T @ moves, held.T)
