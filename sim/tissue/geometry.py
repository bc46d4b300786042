# SPDX-License-Identifier: GPL-3.0-or-later
"""Closest points on surfaces and Laplacians of fields on the skin."""

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

TIE = 1e-6  # mm within which distances are equal


def closest_on_triangles(points, a, b, c):
    """Closest points (k, 3) on triangles with corners a, b, c (k, 3), one triangle per point (Ericson 2004, 5.1.5)."""
    ab, ac, ap = b - a, c - a, points - a
    d1, d2 = _dot(ab, ap), _dot(ac, ap)
    bp, cp = points - b, points - c
    d3, d4, d5, d6 = _dot(ab, bp), _dot(ac, bp), _dot(ab, cp), _dot(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    total = np.where(np.abs(va + vb + vc) > 1e-30, va + vb + vc, 1.0)
    v, w = vb / total, vc / total
    out = a + v[:, None] * ab + w[:, None] * ac

    def along(origin, edge, part):
        t = np.clip(part, 0, 1)
        return origin + t[:, None] * edge

    e_ab = along(a, ab, d1 / np.maximum(_dot(ab, ab), 1e-30))
    e_ac = along(a, ac, d2 / np.maximum(_dot(ac, ac), 1e-30))
    e_bc = along(b, c - b, (d4 - d3) / np.maximum(_dot(c - b, c - b), 1e-30))
    outside = (v < 0) | (w < 0) | (v + w > 1) | (np.abs(va + vb + vc) <= 1e-30)
    edge = np.stack([e_ab, e_ac, e_bc])
    nearest = np.argmin(((edge - points) ** 2).sum(axis=2), axis=0)
    out[outside] = edge[nearest, np.arange(len(points))][outside]
    return out


def _dot(x, y):
    return np.einsum("ij,ij->i", x, y)


def short_diagonals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(t, 3) triangles of a face table (m, 4): quads split along their shorter diagonal, so that mirrored quads split
    alike and a symmetric head acts symmetrically."""
    quad = faces[:, 3] >= 0
    q = faces[quad]
    one = np.linalg.norm(vertices[q[:, 0]] - vertices[q[:, 2]], axis=1)
    other = np.linalg.norm(vertices[q[:, 1]] - vertices[q[:, 3]], axis=1)
    q = np.where((other < one - 1e-4)[:, None], q[:, [1, 2, 3, 0]], q)
    return np.concatenate([faces[~quad][:, :3], q[:, [0, 1, 2]], q[:, [0, 2, 3]]])


class Surface:
    """Closest-point queries on a triangle mesh: the nearest ``tries`` triangles by centroid are looked at."""

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray, tries: int = 16):
        self.vertices, self.triangles = vertices, triangles
        a, b, c = (vertices[triangles[:, k]] for k in range(3))
        self.normal = np.cross(b - a, c - a)
        self.normal /= np.maximum(np.linalg.norm(self.normal, axis=1, keepdims=True), 1e-12)
        self.tree = cKDTree((a + b + c) / 3)
        self.tries = min(tries, len(triangles))

    def closest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points (k, 3) on the surface, triangle (k,) and distance (k,) mm; the middle of points that are equally near, so that
        the plane of symmetry of a symmetric head keeps to no side."""
        _, near = self.tree.query(points, self.tries)
        near = near.reshape(len(points), -1)
        flat = np.repeat(points, near.shape[1], axis=0)
        tri = self.triangles[near.ravel()]
        found = closest_on_triangles(flat, *(self.vertices[tri[:, k]] for k in range(3)))
        distance = np.linalg.norm(found - flat, axis=1).reshape(near.shape)
        best = np.argmin(distance, axis=1)
        row = np.arange(len(points))
        alike = (distance <= distance[row, best][:, None] + TIE)[..., None]
        point = (alike * found.reshape(*near.shape, 3)).sum(axis=1) / alike.sum(axis=1)
        return point, near[row, best], np.linalg.norm(point - points, axis=1)


def cotangent_stiffness(vertices: np.ndarray, triangles: np.ndarray, floor: float = 0.05) -> sparse.csr_matrix:
    """(n, n) positive semi-definite Laplacian with cotangent weights, no weight under ``floor`` (keeps it a mean)."""
    n = len(vertices)
    rows, cols, weights = [], [], []
    for k in range(3):
        i, j, o = triangles[:, k], triangles[:, (k + 1) % 3], triangles[:, (k + 2) % 3]
        u, v = vertices[i] - vertices[o], vertices[j] - vertices[o]
        cot = _dot(u, v) / np.maximum(np.linalg.norm(np.cross(u, v), axis=1), 1e-9)
        rows.append(i)
        cols.append(j)
        weights.append(np.clip(cot / 2, -2.0, 3.0))
    rows, cols, weights = (np.concatenate(x) for x in (rows, cols, weights))
    w = sparse.csr_matrix((weights, (rows, cols)), (n, n))
    w = w + w.T
    w.data = np.maximum(w.data, floor)
    return (sparse.diags(np.asarray(w.sum(axis=1)).ravel()) - w).tocsr()


def smoothed(values: np.ndarray, laplacian: sparse.spmatrix, area: np.ndarray, length: float) -> np.ndarray:
    """``values`` (n,) or (n, k) evened out over ``length`` mm: one implicit step of diffusion."""
    from scipy.sparse.linalg import splu

    matrix = sparse.diags(area) + length**2 * laplacian
    weighted = values * (area if values.ndim == 1 else area[:, None])
    return splu(matrix.tocsc()).solve(np.ascontiguousarray(weighted))


def unit(vectors) -> np.ndarray:
    """Vectors (n, 3) of length 1; what has no length stays as short."""
    return vectors / np.maximum(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)), 1e-9)[:, None]
