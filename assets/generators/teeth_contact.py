# SPDX-License-Identifier: GPL-3.0-or-later
"""Teeth brought into touch: how near two teeth come, and how far one may move until they meet."""

import numpy as np
from scipy.spatial import cKDTree

from .skull_depth import sampled
from .teeth_shape import tooth_mesh

#: mm left between neighbours and between the rows where they touch.
CONTACT = 0.05
SPACING = 0.4


class Touch:
    """Surfaces of teeth to measure against: places (`ToothPlace`) of the left side and, if ``mirrored``, of the right."""

    def __init__(self, places, mirrored: bool = False):
        points, normals = [], []
        for place in places:
            at, out = _samples(place.tooth)
            turn = place.axes
            points.append(at @ turn + place.neck)
            normals.append(out @ turn)
        self.points, self.normals = np.concatenate(points), np.concatenate(normals)
        if mirrored:
            flip = np.array([-1.0, 1, 1])
            self.points, self.normals = self.points * flip, self.normals * flip
        self._tree = cKDTree(self.points)
        self._low, self._high = self.points.min(axis=0), self.points.max(axis=0)

    def gap(self, place, reach: float = 0.7) -> float:
        """Smallest distance mm from the surface to a tooth in its place, negative where they cut; ``reach`` if far."""
        at, _ = _samples(place.tooth)
        at = at @ place.axes + place.neck
        at = at[((at > self._low - reach) & (at < self._high + reach)).all(axis=1)]
        if not len(at):
            return reach
        distance, near = self._tree.query(at, distance_upper_bound=reach)
        found = np.isfinite(distance)
        if not found.any():
            return reach
        near = near[found]
        height = ((at[found] - self.points[near]) * self.normals[near]).sum(axis=1)
        # samples that face each other tell the gap by its height, being up to half a spacing apart sideways
        facing = (distance[found] < 1.2 * SPACING) | (height < -0.3 * distance[found])
        return float(np.where(facing, height, distance[found]).min())


def first_touch(gap, low: float, high: float, wanted: float = CONTACT, steps: int = 14) -> float:
    """The move between ``low`` (apart) and ``high`` (cutting) at which ``gap(move)`` first falls to ``wanted`` mm."""
    moves = np.linspace(low, high, steps)
    before = low
    for move in moves:
        if gap(move) < wanted:
            break
        before = move
    else:
        return high
    for _ in range(10):
        middle = (before + move) / 2
        before, move = (middle, move) if gap(middle) >= wanted else (before, middle)
    return before


_made = {}


def _samples(tooth):
    """Points and outward normals on the crown of a tooth, in its own axes."""
    if tooth not in _made:
        vertices, faces = tooth_mesh(tooth)
        quad = faces[:, 3] >= 0
        triangles = np.concatenate([faces[:, :3], faces[quad][:, [0, 2, 3]]])
        points, normals = sampled(vertices, triangles, SPACING)
        crown = points[:, 2] > -1.0
        _made[tooth] = points[crown], normals[crown]
    return _made[tooth]
