# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles covered by sample points of about equal spacing, kept in one k-d tree."""

import numpy as np
from scipy.spatial import cKDTree

SAMPLES = 160_000  # a finer cover does not pay for the time its tree takes
MANY = 1000  # points from which on all cores search
FEW = 30_000  # triangles; finer than they are where there are no more: less to try for each query

USUAL = 90  # per cent of the triangles that are no larger than usual


class Cover:
    """Samples of triangles (m, 3, 3) mm of areas (m,) mm², and how far from its samples a triangle may reach.

    owner (s,) : the triangle of each sample; radius (m,) mm : no point of a triangle is farther from the nearest of its
    samples; most : the largest of these; usual : nearly the largest, large triangles left out
    """

    def __init__(self, corners: np.ndarray, area: np.ndarray):
        usual = max(float(np.median(np.sqrt(2 * area))), 1e-6)
        samples, self.owner, self.radius = spread(corners, usual * (0.55 if len(corners) < FEW else 1.3))
        self.most, self.usual = float(self.radius.max()), float(np.percentile(self.radius, USUAL))
        self._tree = cKDTree(samples, leafsize=32, compact_nodes=False, balanced_tree=False)  # what is soonest made

    def nearest(self, points, count, reach):
        """Distance (k, c) mm and index (k, c) of the ``count`` samples nearest to points (k, 3).

        Infinite where no triangle within ``reach`` mm has another.
        """
        count = min(count, self._tree.n)
        cores = -1 if len(points) >= MANY else 1
        far, sample = self._tree.query(points, k=count, distance_upper_bound=reach + self.most, workers=cores)
        return far.reshape(len(points), count), sample.reshape(len(points), count)


def spread(corners: np.ndarray, spacing: float):
    """Sample points over triangles (m, 3, 3) -> points (s, 3), owner (s,), covering radius (m,) in mm."""
    planes = np.ascontiguousarray(corners.reshape(-1, 9).T).reshape(3, 3, -1)  # corner, axis, triangle
    middle = planes.sum(axis=0) / 3
    reach = np.sqrt(np.maximum.reduce([((corner - middle) ** 2).sum(axis=0) for corner in planes]))
    parts = np.clip(np.ceil(reach / spacing), 1, 24).astype(int)
    while (parts**2).sum() > max(SAMPLES, 2 * len(corners)):
        spacing *= 1.2
        parts = np.clip(np.ceil(reach / spacing), 1, 24).astype(int)
    points, owner = [], []
    for n in np.flatnonzero(np.bincount(parts)):
        of = np.flatnonzero(parts == n)
        i, j = np.divmod(np.arange(n * n), n)
        up = i + j < n
        # Middles of the n*n small triangles: the upright ones, then those standing on their tip.
        b = np.concatenate([(i[up] + 1 / 3) / n, (i[(i + j) < n - 1] + 2 / 3) / n])
        c = np.concatenate([(j[up] + 1 / 3) / n, (j[(i + j) < n - 1] + 2 / 3) / n])
        weights = np.stack([1 - b - c, b, c], axis=1)
        points.append(
            (weights @ planes.take(of, axis=2).reshape(3, -1))
            .reshape(len(weights), 3, -1)
            .transpose(1, 0, 2)
            .reshape(3, -1)
        )
        owner.append(np.tile(of, len(weights)))
    return np.concatenate(points, axis=1).T.copy(), np.concatenate(owner), reach / parts
