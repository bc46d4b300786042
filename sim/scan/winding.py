# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles wound the same way round as their neighbours, and outside out: exporters turn some of them, or all."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree


def wound_alike(triangles: np.ndarray, vertex_count: int) -> np.ndarray:
    """(m,) bool: which of the triangles (m, 3) to turn over so that all of a piece are wound alike.

    Of each piece that hangs together by sides of two triangles the fewer are turned; one that cannot be wound alike (a Möbius
    strip) stays as it is. Which side is out, this does not tell.
    """
    m = len(triangles)
    turn = np.zeros(m, dtype=bool)
    one, other, against = _neighbours(np.asarray(triangles), vertex_count)
    if not against.any():
        return turn
    # Every triangle twice, as it is and turned over; those that go together are linked.
    here, there = np.concatenate([one, one + m]), np.concatenate([other + m * against, other + m * ~against])
    links = coo_matrix((np.ones(2 * len(one), dtype=np.int8), (here, there)), shape=(2 * m, 2 * m))
    label = connected_components(links, directed=False)[1]
    as_is, over = label[:m], label[m:]
    piece, second = np.minimum(as_is, over), as_is > over
    one_way, other_way = (np.bincount(piece[some], minlength=2 * m) for some in (~second, second))
    return (as_is != over) & (second == (other_way < one_way)[piece])


def faces_away(points, normals, skin, facing, reach: float) -> bool:
    """Whether a scan is wound inside out: most of its ``points`` (n, 3) mm that are nearest to points of a ``skin`` (k, 3), no
    farther than ``reach``, have ``normals`` (n, 3) against the skin's, ``facing`` (k, 3)."""
    distance, nearest = cKDTree(points).query(skin, distance_upper_bound=reach)
    near = np.isfinite(distance)
    return bool(np.einsum("ij,ij->i", normals[nearest[near]], facing[near]).sum() < 0)


def _neighbours(triangles, n):
    """Pairs of triangles (k,) and (k,) that share a side of theirs alone, and whether both run along it the same way."""
    a, b = triangles.ravel().astype(np.int64), triangles[:, [1, 2, 0]].ravel().astype(np.int64)
    side = np.minimum(a, b) * n + np.maximum(a, b)
    order = np.argsort(side, kind="stable")
    same = side[order][1:] == side[order][:-1]
    # Of sides that are there twice, no oftener.
    before, after = np.concatenate([[False], same[:-1]]), np.concatenate([same[1:], [False]])
    first = np.flatnonzero(same & ~before & ~after)
    one, other = order[first], order[first + 1]
    return one // 3, other // 3, (a < b)[one] == (a < b)[other]
