# SPDX-License-Identifier: GPL-3.0-or-later
"""The feature mesh: landmarks connected to triangles, refined by one vertex per triangle (Kähler et al. 2002, 6.2).

The mesh over the target is subdivided first; where each new vertex ended up is written down relative to its parent
triangle (barycentric B, height D along the triangle's normal) and replayed on the mesh over the source.
"""

import numpy as np


def corner_normals(points, triangles):
    """Unit normals (m, 3) and corners (m, 3, 3) of triangles over ``points``; zero where a triangle has no area."""
    corners = points[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return normal / np.where(length > 1e-12, length, 1), corners


def filtered_normals(points, triangles):
    """Triangle normals (m, 3), averaged once with those of the triangles across the sides (6.2)."""
    normal, _ = corner_normals(points, triangles)
    side, other = neighbours(triangles)
    total = normal.copy()
    for axis in range(3):
        total[:, axis] += np.bincount(side, normal[other, axis], minlength=len(triangles))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 1e-9, total / np.where(length > 1e-9, length, 1), normal)


def neighbours(triangles):
    """Pairs of triangles with a common side, each pair both ways: (k,), (k,)."""
    first, second, _ = _inner_sides(triangles)
    return np.concatenate([first, second]), np.concatenate([second, first])


def _inner_sides(triangles):
    """Sides with two triangles: their indices (k,), (k,) and the side's vertices (k, 2) as the first one runs."""
    t = np.asarray(triangles, dtype=np.int64)
    sides = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    owner = np.tile(np.arange(len(t)), 3)
    code = np.sort(sides, axis=1) @ np.array([t.max() + 1, 1])
    order = np.argsort(code, kind="stable")
    _, start, count = np.unique(code[order], return_index=True, return_counts=True)
    start = start[count == 2]
    a, b = order[start], order[start + 1]
    return owner[a], owner[b], sides[a]


def subdivide(triangles, vertex_count):
    """Each triangle (a, b, c) becomes three around a new vertex, ``vertex_count + its index`` (m -> 3 m)."""
    a, b, c = np.asarray(triangles).T
    new = vertex_count + np.arange(len(a))
    return np.concatenate([np.stack(x, axis=1) for x in ((a, b, new), (b, c, new), (c, a, new))]).astype(np.int32)


def describe(points, triangles, new):
    """B (m, 3) and D (m,): the new vertices (m, 3) relative to their parent triangles."""
    normal, corners = corner_normals(points, triangles)
    ab, ac, ap = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], new - corners[:, 0]
    height = np.einsum("ij,ij->i", ap, normal)
    d11, d12, d22 = (np.einsum("ij,ij->i", u, v) for u, v in ((ab, ab), (ab, ac), (ac, ac)))
    e1, e2 = np.einsum("ij,ij->i", ap, ab), np.einsum("ij,ij->i", ap, ac)
    area = d11 * d22 - d12 * d12
    flat = area <= 1e-9 * np.maximum(d11 * d22, 1e-30)
    safe = np.where(flat, 1, area)
    v, w = (d22 * e1 - d12 * e2) / safe, (d11 * e2 - d12 * e1) / safe
    weights = np.stack([1 - v - w, v, w], axis=1)
    weights[flat] = 1 / 3
    return weights, height


def place(points, triangles, weights, height):
    """New vertices (m, 3) from B and D on the triangles over ``points``."""
    normal, corners = corner_normals(points, triangles)
    return np.einsum("ij,ijk->ik", weights, corners) + height[:, None] * normal


def flip_edges(triangles, old, *shapes):
    """Flip the sides of the previous generation, those between two of the first ``old`` vertices (6.2, figure 4).

    A side is flipped where that does not turn a triangle over in any of ``shapes`` (vertex positions (n, 3)) and does
    not make a side that exists already. Returns triangles (m, 3).
    """
    triangles = np.array(triangles, dtype=np.int32)
    first, second, side = _inner_sides(triangles)
    pick = (side < old).all(axis=1)
    first, second, side = first[pick], second[pick], side[pick]
    a, b = side.T
    c = triangles[first].sum(axis=1) - a - b
    d = triangles[second].sum(axis=1) - a - b
    # Before: (a, b, c) and (b, a, d). After: (a, d, c) and (d, b, c).
    new = np.stack([np.stack([a, d, c], axis=1), np.stack([d, b, c], axis=1)], axis=1)
    good = c != d
    for points in shapes:
        before = filtered_pair(points, np.stack([np.stack([a, b, c], 1), np.stack([b, a, d], 1)], axis=1))
        normal = np.cross(
            points[new[:, :, 1]] - points[new[:, :, 0]], points[new[:, :, 2]] - points[new[:, :, 0]], axis=2
        )
        length = np.linalg.norm(normal, axis=2)
        along = np.einsum("kij,kj->ki", normal, before) / np.maximum(length, 1e-12)
        good &= (along > 0.3).all(axis=1) & (length > 1e-3).all(axis=1)
    # Every triangle has one old side only, so flips do not touch one another; a doubled new side is left alone.
    used = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]).astype(np.int64)
    scale = int(triangles.max()) + 1
    taken = np.unique(np.sort(used, axis=1) @ np.array([scale, 1]))
    code = np.sort(np.stack([c, d], axis=1).astype(np.int64), axis=1) @ np.array([scale, 1])
    _, at, count = np.unique(code, return_index=True, return_counts=True)
    single = np.zeros(len(code), dtype=bool)
    single[at[count == 1]] = True
    good &= single & ~np.isin(code, taken)
    triangles[first[good]], triangles[second[good]] = new[good, 0], new[good, 1]
    return triangles


def filtered_pair(points, pair):
    """Unit sum (k, 3) of the normals of two triangles each, ``pair`` (k, 2, 3)."""
    corners = points[pair]
    normal = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0], axis=2)
    total = normal.sum(axis=1)
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
