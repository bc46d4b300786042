# SPDX-License-Identifier: GPL-3.0-or-later
"""How far flesh reaches round the mouth: distance to its lining, the cage's and that of the surface drawn."""

import numpy as np
from scipy.spatial import cKDTree

from ...sim.mesh import Mesh, edges
from ...sim.mesh_subdivision import smoother

#: mm between the samples of the lining.
SPACING = 0.7
#: One in so many of them is looked at where the lining is far.
FEW = 24


class MouthLining:
    """The lining of the mouth, as cage and as limit surface: bone has to stay behind both.

    The fornix is a fold so tight that smooth normals would not tell its inside from its outside; those of faces, edges
    and corners do (Baerentzen and Aanaes 2005).
    """

    def __init__(self, skin: Mesh, groups: dict[str, np.ndarray]):
        bag = np.asarray(groups.get("mouth_bag", np.zeros(len(skin.vertices))), float) > 0.4
        mine = bag[skin.faces].all(axis=1)
        self._trees, self._normals, self._sparse = [], [], []
        if not mine.any():
            return
        operator, quads = smoother(skin.faces, len(skin.vertices), 2)
        fine = operator @ bag.astype(float)
        drawn = quads[(fine[quads] > 0.99).all(axis=1)]
        for vertices, faces in ((skin.vertices, skin.faces[mine]), (operator @ skin.vertices, drawn)):
            points, normals = _samples(vertices, Mesh(vertices, faces).triangles)
            self._trees.append(cKDTree(points))
            self._normals.append(normals)
            self._sparse.append(cKDTree(points[::FEW]))

    def depth(self, points: np.ndarray, reach: float = 8.0) -> np.ndarray:
        """(n,) mm of flesh between points (n, 3) and the lining, at most ``reach``, negative in the hollow of the mouth."""
        out = np.full(len(points), reach)
        for tree, sparse, normals in zip(self._trees, self._sparse, self._normals, strict=True):
            ask = np.flatnonzero(((points > tree.mins - reach) & (points < tree.maxes + reach)).all(axis=1))
            distance, near = tree.query(points[ask], distance_upper_bound=reach)
            far = np.flatnonzero(~np.isfinite(distance))
            near[far] = 0
            air = ((points[ask] - tree.data[near]) * normals[near]).sum(axis=1) > 0
            # What is farther may still lie in the hollow, if all of the lining around says so.
            away, some = sparse.query(points[ask[far]], k=8)
            distance[far] = away[:, 0]
            gap = points[ask[far], None] - sparse.data[some]
            air[far] = ((gap * normals[some * FEW]).sum(axis=2) > 0).all(axis=1)
            out[ask] = np.minimum(out[ask], np.where(air, -distance, distance))
        return out


def _samples(vertices, triangles):
    """Points (k, 3) on faces, edges and corners, and the normals (k, 3) that tell the sides of the surface there."""
    corner = vertices[triangles]
    side = np.roll(corner, -1, axis=1) - corner
    normal = np.cross(side[:, 0], side[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    unit = side / np.maximum(np.linalg.norm(side, axis=2, keepdims=True), 1e-12)
    angle = np.arccos(np.clip(-(unit * np.roll(unit, 1, axis=1)).sum(axis=2), -1, 1))
    at_corner = np.zeros_like(vertices)
    np.add.at(at_corner, triangles, angle[..., None] * normal[:, None])
    used = np.unique(triangles)
    points, normals = [vertices[used]], [at_corner[used]]

    pairs = edges(np.column_stack([triangles, np.full(len(triangles), -1)]).astype(np.int32)).astype(np.int64)
    span = len(vertices)
    sides = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2), axis=2).astype(np.int64)
    of = np.searchsorted(pairs[:, 0] * span + pairs[:, 1], sides[..., 0] * span + sides[..., 1])
    at_edge = np.zeros((len(pairs), 3))
    np.add.at(at_edge, of, normal[:, None])
    a, b = vertices[pairs[:, 0]], vertices[pairs[:, 1]]
    parts = np.maximum(1, np.ceil(np.linalg.norm(b - a, axis=1) / SPACING)).astype(int)
    for n in np.unique(parts[parts > 1]):
        t = (np.arange(1, n) / n)[:, None]
        some = parts == n
        points.append((a[some, None] * (1 - t) + b[some, None] * t).reshape(-1, 3))
        normals.append(np.repeat(at_edge[some], n - 1, axis=0))

    parts = np.maximum(3, np.ceil(np.linalg.norm(side, axis=2).max(axis=1) / SPACING)).astype(int)
    for n in np.unique(parts):
        i, j = (x.ravel() for x in np.meshgrid(np.arange(1, n), np.arange(1, n), indexing="ij"))
        keep = i + j < n
        weights = np.stack([i[keep], j[keep], n - i[keep] - j[keep]], axis=1) / n
        some = parts == n
        points.append(np.einsum("wk,tkd->twd", weights, corner[some]).reshape(-1, 3))
        normals.append(np.repeat(normal[some], len(weights), axis=0))
    points, normals = np.concatenate(points), np.concatenate(normals)
    return points, normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
