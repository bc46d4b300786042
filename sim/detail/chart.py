# SPDX-License-Identifier: GPL-3.0-or-later
"""The UV chart of a subdivided skin: which point of the drawn surface each texel shows.

Between the vertices of the fine mesh the surface is curved by Phong tessellation (Boubekeur and Alexa 2008) with the
factor 1/2 that is exact for parabolas, so that facets leave no trace in the maps.
"""

from dataclasses import dataclass

import numpy as np

from ..mesh import Mesh, vertex_normals
from ..mesh_subdivision import smoother

#: Triangle-texel pairs examined at once, and texels placed at once: bound the memory.
BATCH = 1_000_000
LEVELS = 2


@dataclass(frozen=True, eq=False)
class Chart:
    """A triangulated chart of the drawn surface.

    vertices (n, 3) mm, apart along seams; normals, tangents (n, 3) unit; along_u, along_v (n, 3) mm : derivatives of
    the place by u and v; triangles (t, 3); uv (n, 2); cage (n, m) sparse : carries values of the cage's vertices here
    """

    vertices: np.ndarray
    normals: np.ndarray
    tangents: np.ndarray
    along_u: np.ndarray
    along_v: np.ndarray
    triangles: np.ndarray
    uv: np.ndarray
    cage: object


@dataclass(frozen=True, eq=False)
class Texels:
    """Texels that the chart covers: index (k,) = row * size + column (row 0 at v = 0), triangle (k,), weights (k, 3)."""

    size: int
    index: np.ndarray
    triangle: np.ndarray
    weights: np.ndarray

    def block(self, part: slice) -> "Texels":
        """Some of the texels."""
        return Texels(self.size, self.index[part], self.triangle[part], self.weights[part])

    def across(self, chart: Chart, values: np.ndarray) -> np.ndarray:
        """Values (n, ...) of the chart's vertices at the texels (k, ...)."""
        return np.einsum("ki,ki...->k...", self.weights, values[chart.triangles[self.triangle]])

    def points(self, chart: Chart) -> np.ndarray:
        """(k, 3) mm on the curved surface."""
        corner = chart.triangles[self.triangle]
        flat = np.einsum("ki,kij->kj", self.weights, chart.vertices[corner])
        out = flat.copy()
        for k in range(3):  # half of the way to the corners' tangent planes
            normal = chart.normals[corner[:, k]]
            off = np.einsum("kj,kj->k", flat - chart.vertices[corner[:, k]], normal)
            out -= (0.5 * self.weights[:, k] * off)[:, None] * normal
        return out


def chart_of(skin: Mesh, levels: int = LEVELS) -> Chart:
    """The chart of the surface drawn of the cage ``skin`` (mm, with UVs), UVs interpolated linearly in each face."""
    operator, quads = smoother(skin.faces, len(skin.vertices), levels)
    vertices = operator @ skin.vertices
    uv = np.asarray(skin.uv, dtype=float)
    for _ in range(levels):  # corner, side after it, middle, side before it: the order of `subdivision`
        after, before = (uv + np.roll(uv, -1, axis=1)) / 2, (uv + np.roll(uv, 1, axis=1)) / 2
        middle = np.broadcast_to(uv.mean(axis=1, keepdims=True), uv.shape)
        uv = np.stack([uv, after, middle, before], axis=2).reshape(-1, 4, 2)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    uv = np.concatenate([uv[:, [0, 1, 2]], uv[:, [0, 2, 3]]]).reshape(-1, 2)
    normals = vertex_normals(vertices, triangles)
    # Beside a seam a vertex has two places in the chart, and two tangents as in MikkTSpace: part it.
    grid = np.round(uv * 2**20).astype(np.int64)
    key = (triangles.ravel().astype(np.int64) << 42) + (grid[:, 0] << 21) + grid[:, 1]
    _, first, corner = np.unique(key, return_index=True, return_inverse=True)
    whole = triangles.ravel()[first]
    triangles = corner.reshape(-1, 3).astype(np.int32)
    vertices, normals, uv, operator = vertices[whole], normals[whole], uv[first], operator[whole]
    along_u, along_v = _derivatives(vertices, triangles, uv)
    tangents = along_u - np.einsum("ij,ij->i", along_u, normals)[:, None] * normals
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-12)
    return Chart(vertices, normals, tangents, along_u, along_v, triangles, uv, operator)


def _derivatives(vertices, triangles, uv):
    """Derivatives of the place by u and by v at the vertices (n, 3): the triangles' own, averaged by area of chart."""
    e1, e2 = (vertices[triangles[:, k]] - vertices[triangles[:, 0]] for k in (1, 2))
    (u1, v1), (u2, v2) = ((uv[triangles[:, k]] - uv[triangles[:, 0]]).T for k in (1, 2))

    def gathered(values):
        return np.bincount(triangles.ravel(), np.repeat(values, 3), minlength=len(vertices))

    weight = gathered(u1 * v2 - u2 * v1)[:, None]
    weight = np.where(np.abs(weight) > 1e-15, weight, 1.0)
    both = (e1 * v2[:, None] - e2 * v1[:, None], e2 * u1[:, None] - e1 * u2[:, None])
    return tuple(np.stack([gathered(by[:, k]) for k in range(3)], axis=1) / weight for by in both)


def texels(chart: Chart, use: np.ndarray, size: int) -> Texels:
    """The texels whose centres the triangles ``use`` (t,) bool of the chart cover, in a square of ``size`` texels."""
    corner = chart.uv[chart.triangles] * size
    low = np.clip(np.ceil(corner.min(axis=1) - 0.5), 0, size).astype(np.int64)
    high = np.clip(np.floor(corner.max(axis=1) - 0.5), -1, size - 1).astype(np.int64)
    e1, e2 = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    det = e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]
    span = high - low + 1
    chosen = np.flatnonzero(use & (span > 0).all(axis=1) & (np.abs(det) > 1e-12))
    pairs = span[chosen].prod(axis=1)
    total = np.cumsum(pairs)
    which = np.full(size * size, -1, dtype=np.int32)
    weights = np.zeros((size * size, 3), dtype=np.float32)
    start = 0
    while start < len(chosen):
        reached = total[start - 1] if start else 0
        stop = max(start + 1, int(np.searchsorted(total, reached + BATCH, side="right")))
        count = pairs[start:stop]
        of = np.repeat(chosen[start:stop], count)
        step = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
        x, y = low[of, 0] + step % span[of, 0], low[of, 1] + step // span[of, 0]
        dx, dy = x + 0.5 - corner[of, 0, 0], y + 0.5 - corner[of, 0, 1]
        v = (dx * e2[of, 1] - dy * e2[of, 0]) / det[of]
        w = (e1[of, 0] * dy - e1[of, 1] * dx) / det[of]
        inside = (v >= -1e-9) & (w >= -1e-9) & (v + w <= 1 + 1e-9)
        at = (y * size + x)[inside]
        which[at] = of[inside]
        weights[at] = np.stack([1 - v - w, v, w], axis=1)[inside]
        start = stop
    index = np.flatnonzero(which >= 0)
    return Texels(size, index, which[index], weights[index])
