# SPDX-License-Identifier: GPL-3.0-or-later
"""The closest point of a triangle, for many pairs of point and triangle at once."""

import numpy as np

#: Pairs worked on at once: few enough to stay in the cache of a core.
BLOCK = 16_000


class Triangles:
    """Triangles (m, 3, 3) mm as nine planes of numbers, so that many pairs are worked on without small vectors."""

    def __init__(self, corners):
        self._planes = np.ascontiguousarray(np.asarray(corners, dtype=float).reshape(-1, 9).T)

    def closest(self, points, row, owner):
        """Barycentric weights (k, 3) of the point of triangle ``owner`` (k,) closest to ``points[row]``, distance (k,).

        points (n, 3) mm; row (k,) indices.
        """
        weights, distance = np.empty((len(row), 3)), np.empty(len(row))
        points = np.ascontiguousarray(np.asarray(points, dtype=float).T)
        for start in range(0, len(row), BLOCK):
            part = slice(start, start + BLOCK)
            corners = self._planes.take(owner[part], axis=1)
            weights[part], distance[part] = _closest(points.take(row[part], axis=1), *np.split(corners, 3))
        return weights, distance


def closest_on_triangles(p, a, b, c):
    """Barycentric weights (k, 3) of the point of triangle ``a b c`` closest to ``p``, and its distance (k,).

    All arguments (k, 3). The foot of the perpendicular where it falls inside, otherwise the best of the three sides.
    """
    weights, distance = np.empty((len(p), 3)), np.empty(len(p))
    for start in range(0, len(p), BLOCK):
        part = slice(start, start + BLOCK)
        weights[part], distance[part] = _closest(*(np.ascontiguousarray(x[part].T) for x in (p, a, b, c)))
    return weights, distance


def _closest(p, a, b, c):
    """`closest_on_triangles` for planes (3, k)."""
    ab, ac, ap = b - a, c - a, p - a
    d11, d12, d22, e1, e2 = _dot(ab, ab), _dot(ab, ac), _dot(ac, ac), _dot(ap, ab), _dot(ap, ac)
    area = d11 * d22 - d12 * d12
    safe = np.where(area > 0, area, 1)
    v, w = (d22 * e1 - d12 * e2) / safe, (d11 * e2 - d12 * e1) / safe
    weights = [1 - v - w, v, w]
    rows = np.flatnonzero((np.minimum(np.minimum(*weights[:2]), w) < 0) | (area <= 0))
    if len(rows):
        corner, q = [x.take(rows, axis=1) for x in (a, b, c)], p.take(rows, axis=1)
        best, shares = np.full(len(rows), np.inf), [np.zeros(len(rows)) for _ in range(3)]
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            side, off = corner[j] - corner[i], q - corner[i]
            length = _dot(side, side)
            t = np.clip(_dot(off, side) / np.where(length > 0, length, 1), 0, 1)
            gap = off - t * side
            square = _dot(gap, gap)
            better = square < best
            np.copyto(best, square, where=better)
            for each, share in ((i, 1 - t), (j, t), (k, 0.0)):
                np.copyto(shares[each], share, where=better)
        for weight, share in zip(weights, shares, strict=True):
            weight[rows] = share
    gap = p - weights[0] * a - weights[1] * b - weights[2] * c
    return np.stack(weights, axis=1), np.sqrt(_dot(gap, gap))


def _dot(u, v):
    # Which of two triangles with a common side is the nearer is up to the last bit: the order of this sum, einsum's,
    # shows in the assets.
    return u[0] * v[0] + u[2] * v[2] + u[1] * v[1]
