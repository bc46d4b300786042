# SPDX-License-Identifier: GPL-3.0-or-later
"""The soft tissue muscles live in: under the skin, outside bone, mouth and eyeballs (Kähler 2002, 5.2, item 3)."""

from functools import cached_property
from itertools import islice

import numpy as np
from scipy.spatial import cKDTree

from ..mesh import Mesh, vertex_normals
from ..triangle_projection import Triangles

#: Points from which on all cores search.
MANY = 1000
#: mm between the points a surface is sampled by.
SPACING = 1.6
#: mm of skin kept over a muscle; how near it may come to the lining of mouth and lids, and to bone.
SKIN_CLEAR, LINING_CLEAR, BONE_CLEAR, EYE_CLEAR = 0.45, 0.2, 0.22, 0.25
#: Digits of a millimetre by which the nearest is told: of two as near, rounding errors would choose.
DIGITS = 6
#: Cosine to a wall under which it stands beside a way, not across it; mm beyond which nothing bounds a way, and by how
#: many at once a point is brought back; mm within bone that are believed.
ASIDE, FAR, DEEP, BURIED = 0.3, 6.0, 2.0, 3.0


class Room:
    """The soft tissue between skin and bone.

    skin, bones : meshes, mm; bones may be empty. inner : (n,) bool, the skin's vertices that line mouth, nose and
    lids (the group ``inner``). eyes : (centre (3,), radius) of each eyeball. mirrored : quads count split along either
    diagonal, so that a surface and its mirror image agree. Surfaces are found by points sampled on them.
    """

    def __init__(self, skin: Mesh, bones: list[Mesh], inner: np.ndarray | None = None, eyes=(), mirrored: bool = True):
        inner = np.zeros(len(skin.vertices), bool) if inner is None else np.asarray(inner, bool)
        split = both_ways if mirrored else _one_way
        triangles = split(skin.faces)
        normals = vertex_normals(skin.vertices, triangles)
        self._lining = inner[triangles].all(axis=1)
        self._seen = skin.vertices, triangles[~self._lining], normals
        self._whole = Samples(skin.vertices, triangles, normals, np.where(self._lining, SPACING / 2, SPACING))
        self.bones = [Samples(mesh.vertices, split(mesh.faces)) for mesh in bones]
        self.eyes = tuple(eyes)

    @cached_property
    def skin(self) -> "Samples":
        """The skin that one sees."""
        return Samples(*self._seen)

    def outward(self, points) -> np.ndarray:
        """(n, 3) unit direction to the skin's outside, smoothed over some mm."""
        return self.skin.smooth_normal(points)

    def walls(self, points, reach: float = 8.0):
        """For each wall near ``points`` (n, 3): mm (n,) they are clear of it (negative: within it), and the way off it.

        The way is (n, 3) unit; where a wall is farther than ``reach`` mm the distance is infinite.
        """
        for bone in self.bones:
            height, away, _ = bone.height(points, reach, -0.5)
            # far from a sharp edge its normal cannot tell inside from outside, and no muscle lies deep in bone
            yield np.where(height > -BURIED, height - BONE_CLEAR, np.inf), away
        for centre, radius in self.eyes:
            away = points - centre
            far = np.linalg.norm(away, axis=1)
            clear = far - radius - EYE_CLEAR
            yield np.where(clear < reach, clear, np.inf), away / np.maximum(far, 1e-9)[:, None]
        height, away, triangle = self._whole.height(points, reach, 0.5)
        clear = np.where(self._lining[triangle], LINING_CLEAR, SKIN_CLEAR)
        yield np.where(np.isfinite(height), -height - clear, np.inf), -away

    def near_lining(self, points, reach: float) -> np.ndarray:
        """(n,) bool: the skin within ``reach`` mm of ``points`` (n, 3) lines mouth, nose or lids."""
        height, _, triangle = self._whole.height(points, reach)
        return np.isfinite(height) & self._lining[triangle]

    def span(self, points, ways):
        """From where to where ``points`` (n, 3) may move along the unit ``ways`` (n, 3): (n,) and (n,) mm.

        From at most 0 to at least 0 where a point is clear of every wall; walls beside the way do not count.
        """
        least, most = np.full(len(points), -FAR), np.full(len(points), FAR)
        for clear, away in self.walls(points):
            slope = np.einsum("nj,nj->n", away, ways)
            off = np.clip(clear, -DEEP, FAR) / np.maximum(np.abs(slope), 0.5)
            most = np.where(slope < -ASIDE, np.minimum(most, off), most)
            least = np.where(slope > ASIDE, np.maximum(least, -off), least)
        return least, most

    def fitted(self, points, rounds: int = 12) -> np.ndarray:
        """Single ``points`` (n, 3) mm brought into the soft tissue by the shortest way; the skin has the last word."""
        points = np.array(points, dtype=float)
        for _ in range(rounds):
            before = points.copy()
            for k in range(len(self.bones) + len(self.eyes) + 1):
                clear, away = next(islice(self.walls(points), k, None))
                points = points + np.clip(-clear, 0, 3.0)[:, None] * away
            if np.abs(points - before).max(initial=0) < 1e-3:
                break
        return points


def diagonals(faces):
    """Triangles (t, 3) of quads split along the one diagonal, and along the other; triangles are in both."""
    quads = np.where(faces[:, 3:] >= 0, faces, faces[:, [0, 1, 2, 0]])
    for corners in (((0, 1, 2), (0, 2, 3)), ((1, 2, 3), (1, 3, 0))):
        triangles = np.concatenate([quads[:, corner] for corner in corners])
        whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
        yield np.concatenate([triangles[whole], faces[faces[:, 3] < 0][:, :3]]) if corners[0][0] else triangles[whole]


def _one_way(faces):
    return next(diagonals(faces))


def both_ways(faces) -> np.ndarray:
    """(t, 3): quads split along either diagonal, so that a surface and its mirror image agree."""
    return np.concatenate(list(diagonals(faces)))


def unit(vectors):
    """Vectors (..., 3) of length 1."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


class Samples:
    """A surface (n, 3), (m, 3) as points about ``spacing`` mm apart (a number, or one for each triangle), smooth normals.

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
        self.points, self._owner = np.round(np.concatenate(points), DIGITS), np.concatenate(owner)
        self._corner, self._bent, self._solid = corner, bent, Triangles(corner)
        self.normals = unit(bent.mean(axis=1))[self._owner]
        self._tree = cKDTree(self.points)

    def height(self, points, reach=np.inf, doubt=0.0):
        """(n,) mm above the surface (negative inside), the (n, 3) way out of it and the (n,) triangle that is near.

        Where no sample is within ``reach`` mm the height is infinite. Exact for the triangles of the nearest samples.
        doubt : cosine between the normal and the way to a point that makes it lie inside; round sharp edges normals
        mislead, so -0.5 takes only what is plainly inside for inside, 0.5 all that is not plainly outside
        """
        count = min(3, len(self.points))  # in a fold the nearest sample may not be the nearest triangle's
        cores = -1 if len(points) >= MANY else 1
        points = np.round(points, DIGITS)
        far, near = self._tree.query(points, k=count, distance_upper_bound=reach, workers=cores)
        far, near = far.reshape(len(points), -1), near.reshape(len(points), -1)
        found = np.isfinite(far[:, 0])
        triangle = self._owner[np.where(np.isfinite(far), near, np.where(found[:, None], near[:, :1], 0))]
        rows = np.repeat(np.arange(len(points)), count)
        weights, distance = self._solid.closest(points, rows, triangle.ravel())
        best = np.round(distance, DIGITS).reshape(-1, count).argmin(axis=1) + count * np.arange(len(points))
        weights, distance, triangle = weights[best], distance[best], triangle.ravel()[best]
        smooth = unit(np.einsum("nk,nkd->nd", weights, self._bent[triangle]))
        away = points - np.einsum("nk,nkd->nd", weights, self._corner[triangle])
        side = np.where((away * smooth).sum(1) < doubt * distance, -1.0, 1.0)
        away = np.where(distance[:, None] > 1e-3, away * side[:, None] / np.maximum(distance, 1e-3)[:, None], smooth)
        return np.where(found, side * distance, np.inf), away, triangle

    def about(self, points):
        """(n,) mm to the nearest sample, negative inside, infinite beyond 3 mm: quick and rough."""
        points = np.round(points, DIGITS)
        far, near = self._tree.query(points, distance_upper_bound=3.0)
        near = np.where(np.isfinite(far), near, 0)
        inside = ((points - self.points[near]) * self.normals[near]).sum(1) < 0
        return np.where(inside & np.isfinite(far), -far, far)

    def nearest(self, points):
        """(n, 3) mm: the sample nearest to each point."""
        return self.points[self._tree.query(np.round(points, DIGITS))[1]]

    def smooth_normal(self, points, count: int = 24):
        """(n, 3) unit: the mean direction of the nearest samples."""
        far, near = self._tree.query(np.round(points, DIGITS), k=min(count, len(self.points)))
        weight = np.exp(-(((far - far[:, :1]) / 2.5) ** 2))[..., None]
        normal = (weight * self.normals[near]).sum(axis=1)
        return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
