# SPDX-License-Identifier: GPL-3.0-or-later
"""The room inside the mouth, measured on the lining that the subdivided skin has."""

import numpy as np
from scipy.ndimage import gaussian_filter, maximum_filter
from scipy.spatial import cKDTree

from ...sim.mesh import Mesh
from ...sim.mesh_subdivision import limit, subdivision
from .skull_depth import sampled

#: mm between the columns of the height maps of roof and floor.
COLUMN = 1.0


class MouthRoom:
    """Lips' backs and mouth bag as the limit surface of the skin.

    Attributes
    ----------
    line : z of the line where the lips meet, mm
    back : y of the bag's back wall at its middle, mm
    """

    def __init__(self, skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray]):
        sto = np.asarray(landmarks["sto"], float)
        self.line = float(sto[2])
        lining = np.asarray(groups["inner"]) > 0.5
        lining &= (np.asarray(groups["mouth_bag"]) > 0.5) | (np.linalg.norm(skin.vertices - sto, axis=1) < 45)
        real = skin.faces >= 0
        mine = (lining[skin.faces] | ~real).all(axis=1) & (np.abs(skin.vertices[skin.faces[:, 0], 2] - sto[2]) < 32)
        operator, quads, parent = subdivision(skin.faces, len(skin.vertices), 2)
        smooth = limit(quads, operator.shape[0]) @ (operator @ skin.vertices)
        self.triangles = Mesh(smooth, quads[mine[parent]]).triangles
        self.vertices = smooth
        self._points, self._normals = sampled(smooth, self.triangles, 0.8)
        self._tree = cKDTree(self._points)
        cage, self._cage_normals = sampled(skin.vertices, Mesh(skin.vertices, skin.faces[mine]).triangles, 0.8)
        self._cage = cKDTree(cage)
        self.back = float(self._points[np.abs(self._points[:, 0]) < 8, 1].max())
        self._maps = {rise: self._map(rise) for rise in (1, -1)}

    def _map(self, rise):
        """Height map of the roof (+1) or floor (-1): the lining nearest to the line of the lips in each column."""
        away = rise * (self._points[:, 2] - self.line)
        some = (away > 0.3) & (rise * self._normals[:, 2] < -0.2)
        low = np.floor(self._points[:, :2].min(axis=0)) - 2
        shape = np.ceil((self._points[:, :2].max(axis=0) - low) / COLUMN).astype(int) + 3
        nearest = np.full(shape, np.inf)
        cell = np.rint((self._points[some, :2] - low) / COLUMN).astype(int)
        np.minimum.at(nearest, (cell[:, 0], cell[:, 1]), away[some])
        known = np.isfinite(nearest)
        # columns between the samples: as their neighbours; outside of the mouth there is no room
        spread = -maximum_filter(np.where(known, -nearest, -np.inf), 3)
        filled = np.where(known, nearest, np.where(np.isfinite(spread), spread, 0.0))
        return low, gaussian_filter(filled, 0.7)

    def limit(self, xy: np.ndarray, rise: int) -> np.ndarray:
        """(k,) z of the roof (``rise`` +1) or the floor (-1) over or under points (k, 2)."""
        low, heights = self._maps[rise]
        at = (np.asarray(xy, float) - low) / COLUMN
        i = np.clip(np.floor(at).astype(int), 0, np.array(heights.shape) - 2)
        u, v = np.clip(at - i, 0, 1).T
        i, j = i.T
        h = heights
        mixed = (h[i, j] * (1 - u) + h[i + 1, j] * u) * (1 - v) + (h[i, j + 1] * (1 - u) + h[i + 1, j + 1] * u) * v
        return self.line + rise * mixed

    def clearance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(k,) mm from points (k, 3) to the lining, negative in the flesh, and (k, 3) the lining's normal into the room."""
        distance, near = self._tree.query(points)
        height = ((points - self._points[near]) * self._normals[near]).sum(axis=1)
        return np.where(height < 0, -distance, distance), self._normals[near]

    def kept_in(
        self, points: np.ndarray, clear: float | np.ndarray, rounds: int = 4, dip: float = np.inf
    ) -> np.ndarray:
        """(k, 3) points, those nearer to the lining than ``clear`` mm (or in the flesh) moved off it.

        dip : mm that they may lie behind the cage, which stands out from the lining where that is round
        """
        points = np.array(points, float)
        for _ in range(rounds):
            room, normal = self.clearance(points)
            points += np.clip(clear - room, 0, 4.0)[:, None] * normal
            if np.isfinite(dip):
                behind, normal = self.behind_cage(points)
                points += np.clip(behind - dip, 0, 4.0)[:, None] * normal
        return points

    def behind_cage(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(k,) mm by which points (k, 3) lie behind the lining's cage, 0 before it, and (k, 3) the cage's normal."""
        distance, near = self._cage.query(points)
        normal = self._cage_normals[near]
        return np.where(((points - self._cage.data[near]) * normal).sum(axis=1) < 0, distance, 0.0), normal
