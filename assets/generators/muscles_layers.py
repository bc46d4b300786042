# SPDX-License-Identifier: GPL-3.0-or-later
"""Muscles in layers: each slides over those that lie deeper, and all keep off bone, skin and the mouth's lining."""

import numpy as np
from scipy.spatial import cKDTree

from ...sim.anatomy.muscle_room import DIGITS, Samples
from ...sim.mesh import Mesh

#: mm left between two layers; how far beside a point a deeper muscle still counts as under it.
GAP, BESIDE = 0.15, 1.5
#: mm from a shared node within which muscles may grow into each other.
MERGE = 7.0


class Layers:
    """The muscles laid so far, deepest first, on both sides of the head."""

    def __init__(self):
        self._laid: list[tuple] = []

    def add(self, level: float, shape: Mesh, paired: bool) -> None:
        """Let ``shape`` count as laid at ``level`` (0 is deepest), its mirror image too."""
        points = Samples(shape.vertices, shape.triangles).points
        for side in (points, points * [-1, 1, 1])[: 1 + paired]:
            self._laid.append((level, side, side.min(axis=0), side.max(axis=0)))

    def lift(self, points, normals, level) -> np.ndarray:
        """(n,) mm each point (n, 3) must rise along its normal to clear what is deeper; at most 0 where it is clear."""
        low, high = points.min(axis=0) - 9, points.max(axis=0) + 9
        deeper = [s for at, s, a, b in self._laid if at < level and (a < high).all() and (b > low).all()]
        deeper = [s[((s > low) & (s < high)).all(axis=1)] for s in deeper]
        out = np.full(len(points), -np.inf)
        if not sum(map(len, deeper)):
            return out
        deeper = np.concatenate(deeper)
        tree = cKDTree(deeper)
        # along the line through each point: the samples beside it
        for step in np.arange(-7.0, 8.1, 1.5):
            far, near = tree.query(np.round(points + step * normals, DIGITS), distance_upper_bound=1.2 * BESIDE)
            found = np.flatnonzero(np.isfinite(far))
            away = deeper[near[found]] - points[found]
            above = np.einsum("nj,nj->n", away, normals[found])
            beside = (away**2).sum(1) - above**2
            above = np.where(beside < BESIDE**2, above, -np.inf)
            out[found] = np.maximum(out[found], above)
        return out

    def floor(self, level):
        """Callable(points (n, 3), ways (n, 3)) -> (n,) mm by which they must rise to lie `GAP` above what is deeper."""
        return lambda points, ways: self.lift(points, ways, level) + GAP
