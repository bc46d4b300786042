# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertices merged: those in one place, and those too close together to tell the skin anything."""

import numpy as np

from ..mesh import cross_sides, vertex_normals


def weld(vertices: np.ndarray, triangles: np.ndarray, tolerance: float = 1e-5):
    """Merge coincident vertices (texture seams split them) and drop collapsed triangles.

    Returns vertices (n, 3), triangles (m, 3).
    """
    planes = vertices.T.copy()
    low = planes.min(axis=1, keepdims=True, initial=np.inf)
    span = max(float((planes - low).max(initial=0)), 1e-9)
    grid = np.round((planes - low) / (tolerance * span)).astype(np.int64)
    key = (grid[0] << 42) ^ (grid[1] << 21) ^ grid[2]
    in_order = np.sort(key)
    merged = triangles
    if (in_order[1:] == in_order[:-1]).any():  # sorting is enough to tell, and much faster
        _, first, back = np.unique(key, return_index=True, return_inverse=True)
        merged, vertices = back.reshape(-1)[triangles], vertices[first]
        planes = vertices.T.copy()
    a, b, c = (planes.take(merged[:, k], axis=1) for k in range(3))
    longest = np.maximum.reduce([_squares(b - a), _squares(c - b), _squares(a - c)])
    area = np.sqrt(_squares(cross_sides(a, b, c)))
    return used_only(vertices, merged[area > 1e-9 * np.maximum(longest, 1e-30)])


def used_only(vertices, triangles):
    """Vertices (n, 3) without those that no triangle (m, 3) uses, and the triangles (m, 3) int32 over them."""
    used = np.zeros(len(vertices), dtype=bool)
    used[triangles.ravel()] = True
    return vertices[used], (np.cumsum(used, dtype=np.int32) - 1)[triangles]


def clustered(vertices: np.ndarray, triangles: np.ndarray, cell: float):
    """A mesh of which the vertices within a cube of ``cell`` mm are one, their mean (Rossignac and Borrel 1993).

    Vertices that face another way, by the signs of their normals, stay apart: lips that touch and thin ears do not
    grow together. Returns vertices (n, 3) mm, triangles (m, 3) without those that collapsed or came to lie twice.
    """
    grid = np.floor((vertices - vertices.min(axis=0)) / cell).astype(np.int64)
    facing = (vertex_normals(vertices, triangles) > 0) @ np.array([1, 2, 4])
    key = (((grid[:, 0] << 20) + grid[:, 1] << 20) + grid[:, 2] << 3) + facing
    _, merged, count = np.unique(key, return_inverse=True, return_counts=True)
    merged = merged.reshape(-1)
    mean = np.stack([np.bincount(merged, vertices[:, k]) / count for k in range(3)], axis=1)
    triangles = merged[triangles]
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    # The smallest corner first, so that a triangle that occurs twice is the same row, and one turned over another.
    turn = (triangles.argmin(axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(triangles, turn, axis=1).T
    order = np.lexsort((c, b, a))
    a, b, c = a[order], b[order], c[order]
    new = np.concatenate([[True], (a[1:] != a[:-1]) | (b[1:] != b[:-1]) | (c[1:] != c[:-1])]) if len(a) else a > 0
    return used_only(mean, np.stack([a[new], b[new], c[new]], axis=1))


def _squares(v):
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
