# SPDX-License-Identifier: GPL-3.0-or-later
"""Which triangles pierce which: exact to the arithmetic, for a mesh with itself and for two meshes."""

import numpy as np

from .box_tree import BoxTree

_SIDES = ((0, 1, 2), (1, 2, 0), (2, 0, 1))  # two corners of a side, and the corner across


def self_piercings(vertices, triangles, among=None) -> np.ndarray:
    """(k, 2) pairs of triangles of one mesh of which one pierces the other.

    Two that share a vertex count if the side across from it passes through the other triangle; two that share a side
    only meet there. Touching does not count.

    Parameters
    ----------
    vertices : (n, 3) mm; triangles : (m, 3)
    among : (m,) bool, at least one of each pair is one of these (None: all)
    """
    triangles = np.asarray(triangles)
    if len(triangles) == 0:
        return np.zeros((0, 2), dtype=np.int64)
    tree = BoxTree.of(vertices, triangles)
    if among is None:
        first, second = tree.overlaps(tree)
    else:
        chosen = np.flatnonzero(among)
        if len(chosen) == 0:
            return np.zeros((0, 2), dtype=np.int64)
        first, second = BoxTree.of(vertices, triangles[chosen]).overlaps(tree)
        pair = np.unique(np.sort(np.stack([chosen[first], second], axis=1), axis=1), axis=0)
        first, second = pair[pair[:, 0] != pair[:, 1]].T
    return _pierce(vertices, triangles, first, vertices, triangles, second, shared=True)


def piercings(vertices, triangles, other_vertices, other_triangles) -> np.ndarray:
    """(k, 2) pairs of a triangle of one mesh and one of another of which one pierces the other."""
    if len(triangles) == 0 or len(other_triangles) == 0:
        return np.zeros((0, 2), dtype=np.int64)
    first, second = BoxTree.of(vertices, triangles).overlaps(BoxTree.of(other_vertices, other_triangles))
    return _pierce(vertices, triangles, first, other_vertices, other_triangles, second, shared=False)


def _pierce(va, ta, first, vb, tb, second, shared):
    va, vb, ta, tb = np.asarray(va, float), np.asarray(vb, float), np.asarray(ta), np.asarray(tb)
    if shared:
        common = (ta[first][:, :, None] == tb[second][:, None]).sum(axis=(1, 2))
        keep = common < 2
        first, second = first[keep], second[keep]
    hit = np.zeros(len(first), dtype=bool)
    for (v, t, rows), (w, s, others) in (
        ((va, ta, first), (vb, tb, second)),
        ((vb, tb, second), (va, ta, first)),
    ):
        hit |= _sides_through(v, t[rows], w, s[others], shared)
    return np.stack([first[hit], second[hit]], axis=1)


def _sides_through(v, t, w, s, shared):
    """(k,) bool: does a side of triangle ``t`` (k, 3) over ``v`` pass through the inside of ``s`` (k, 3) over ``w``?"""
    out = np.zeros(len(t), dtype=bool)
    corner = w[s]
    base, u, r = corner[:, 0], corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    normal = np.cross(u, r)
    height = np.einsum("kij,kj->ki", v[t] - base[:, None], normal)
    if shared:
        touches = (t[:, :, None] == s[:, None]).any(axis=2)
        height[touches] = 0.0
    for i, j, _ in _SIDES:
        rows = np.flatnonzero(height[:, i] * height[:, j] < 0)
        if len(rows) == 0:
            continue
        h0, h1 = height[rows, i], height[rows, j]
        share = (h0 / (h0 - h1))[:, None]
        at = (1 - share) * v[t[rows, i]] + share * v[t[rows, j]] - base[rows]
        n = normal[rows]
        size = np.maximum(np.einsum("ij,ij->i", n, n), 1e-30)
        p = np.einsum("ij,ij->i", np.cross(at, r[rows]), n) / size
        q = np.einsum("ij,ij->i", np.cross(u[rows], at), n) / size
        out[rows[(p > 0) & (q > 0) & (p + q < 1)]] = True
    return out
