# SPDX-License-Identifier: GPL-3.0-or-later
"""The soft tissue muscles live in: under the skin, outside bone, mouth and eyeballs (Kähler 2002, 5.2, item 3)."""

import numpy as np
from scipy.spatial import cKDTree

from ..mesh import Mesh, vertex_normals
from ..triangle_projection import closest_on_triangles

#: mm between the points a surface is sampled by.
SPACING = 1.6
#: mm of skin kept over a muscle; how near it may come to the lining of mouth and lids, and to bone.
SKIN_CLEAR, LINING_CLEAR, BONE_CLEAR, EYE_CLEAR = 0.45, 0.2, 0.12, 0.2


class Room:
    """The soft tissue between skin and bone.

    skin, bones : meshes, mm; bones may be empty. inner : (n,) bool, the skin's vertices that line mouth, nose and
    lids (the group ``inner``). eyes : (centre (3,), radius) of each eyeball. Surfaces are found by points sampled
    on them.
    """

    def __init__(self, skin: Mesh, bones: list[Mesh], inner: np.ndarray | None = None, eyes=()):
        inner = np.zeros(len(skin.vertices), bool) if inner is None else np.asarray(inner, bool)
        normals = vertex_normals(skin.vertices, both_ways(skin.faces))
        self.skins, self.linings = [], []
        for triangles in diagonals(skin.faces):
            lining = inner[triangles].all(axis=1)
            self.skins.append(Samples(skin.vertices, triangles[~lining], normals))
            if lining.any():
                self.linings.append(Samples(skin.vertices, triangles[lining], normals, SPACING / 2))
        self.skin = self.skins[0]
        #: For each bone its surface with quads split along one diagonal and along the other.
        self.bones = [[Samples(mesh.vertices, t) for t in diagonals(mesh.faces)] for mesh in bones]
        self.eyes = tuple(eyes)

    def outward(self, points) -> np.ndarray:
        """(n, 3) unit direction to the skin's outside, smoothed over some mm."""
        return self.skin.smooth_normal(points)

    def fitted(self, points, rounds: int = 12) -> np.ndarray:
        """``points`` (n, 3) mm brought into the soft tissue by the shortest way; the skin has the last word."""
        points = np.array(points, dtype=float)
        todo = np.arange(len(points))
        for _ in range(rounds):
            moved = self._fitted_once(points[todo])
            far = np.abs(moved - points[todo]).max(axis=1) > 1e-3
            points[todo] = moved
            todo = todo[far]
            if not len(todo):
                break
        return points

    def _fitted_once(self, points):
        for solid in (each for bone in self.bones for each in bone):
            height, normal, _ = solid.height(points, 10.0)
            push = np.minimum(np.maximum(BONE_CLEAR - height, 0), 3.0)
            points = points + push[:, None] * normal
        for centre, radius in self.eyes:
            away = points - centre
            far = np.linalg.norm(away, axis=1, keepdims=True)
            points = np.where(far < radius + EYE_CLEAR, centre + away / far * (radius + EYE_CLEAR), points)
        for surface in self.linings:
            points = _under(points, surface, LINING_CLEAR, 6.0)
        for surface in self.skins:
            points = _under(points, surface, SKIN_CLEAR, 5.0)  # farther in, the rim of the lids would mislead
        return points


def diagonals(faces):
    """Triangles (t, 3) of quads split along the one diagonal, and along the other; triangles are in both."""
    quads = np.where(faces[:, 3:] >= 0, faces, faces[:, [0, 1, 2, 0]])
    for corners in (((0, 1, 2), (0, 2, 3)), ((1, 2, 3), (1, 3, 0))):
        triangles = np.concatenate([quads[:, corner] for corner in corners])
        whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
        yield np.concatenate([triangles[whole], faces[faces[:, 3] < 0][:, :3]]) if corners[0][0] else triangles[whole]


def both_ways(faces) -> np.ndarray:
    """(t, 3): quads split along either diagonal, so that a surface and its mirror image agree."""
    return np.concatenate(list(diagonals(faces)))


def _under(points, surface, clear, reach):
    height, normal, far = surface.height(points, reach)
    deep = np.where(np.isfinite(far), np.clip(height + clear, 0, 3.0), 0)
    return points - deep[:, None] * normal


def _unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


class Samples:
    """A surface (n, 3), (m, 3) as points about ``spacing`` mm apart with smooth normals.

    ``normals`` (n, 3): those of a larger surface of which this is a piece.
    """

    def __init__(self, vertices, triangles, normals=None, spacing=SPACING):
        normals = vertex_normals(vertices, triangles) if normals is None else normals
        corner, bent = vertices[triangles], normals[triangles]
        longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
        parts = np.clip(np.ceil(longest / spacing), 1, 20).astype(int)
        points, owner = [], []
        for n in np.unique(parts):
            i, j = (a.ravel() for a in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
            keep = i + j <= n
            w = np.stack([i[keep], j[keep], n - i[keep] - j[keep]], axis=1) / n
            some = np.flatnonzero(parts == n)
            points.append(np.einsum("wk,tkd->twd", w, corner[some]).reshape(-1, 3))
            owner.append(np.repeat(some, len(w)))
        self.points, self._owner = np.concatenate(points), np.concatenate(owner)
        self._corner, self._bent = corner, bent
        self.normals = _unit(bent.mean(axis=1))[self._owner]
        self._tree = cKDTree(self.points)

    def height(self, points, reach=np.inf):
        """(n,) mm above the surface (negative inside), the (n, 3) way out of it and the (n,) mm to the nearest sample.

        Where nothing is within ``reach`` mm both lengths are infinite. Exact for the triangle of the nearest sample.
        """
        count = min(3, len(self.points))  # in a fold the nearest sample may not be the nearest triangle's
        far, near = self._tree.query(points, k=count, distance_upper_bound=reach)
        far, near = far.reshape(len(points), -1), near.reshape(len(points), -1)
        found = np.isfinite(far[:, 0])
        triangle = self._owner[np.where(np.isfinite(far), near, np.where(found[:, None], near[:, :1], 0))]
        corner = self._corner[triangle.ravel()]
        weights, distance = closest_on_triangles(np.repeat(points, count, axis=0), *corner.transpose(1, 0, 2))
        best = distance.reshape(-1, count).argmin(axis=1) + count * np.arange(len(points))
        weights, distance, triangle = weights[best], distance[best], triangle.ravel()[best]
        smooth = _unit(np.einsum("nk,nkd->nd", weights, self._bent[triangle]))
        away = points - np.einsum("nk,nkd->nd", weights, self._corner[triangle])
        side = np.where((away * smooth).sum(1) < 0, -1.0, 1.0)
        away = np.where(distance[:, None] > 1e-3, away * side[:, None] / np.maximum(distance, 1e-3)[:, None], smooth)
        return np.where(found, side * distance, np.inf), away, far[:, 0]

    def about(self, points):
        """(n,) mm to the nearest sample, negative inside, infinite beyond 3 mm: quick and rough."""
        far, near = self._tree.query(points, distance_upper_bound=3.0)
        near = np.where(np.isfinite(far), near, 0)
        inside = ((points - self.points[near]) * self.normals[near]).sum(1) < 0
        return np.where(inside & np.isfinite(far), -far, far)

    def nearest(self, points):
        """(n, 3) mm: the sample nearest to each point."""
        return self.points[self._tree.query(points)[1]]

    def smooth_normal(self, points, count: int = 24):
        """(n, 3) unit: the mean direction of the nearest samples."""
        far, near = self._tree.query(points, k=min(count, len(self.points)))
        weight = np.exp(-(((far - far[:, :1]) / 2.5) ** 2))[..., None]
        normal = (weight * self.normals[near]).sum(axis=1)
        return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
