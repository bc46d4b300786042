# SPDX-License-Identifier: GPL-3.0-or-later
"""The closest point of a triangle, for many pairs of point and triangle at once."""

import numpy as np

#: Pairs worked on at once: few enough to stay in the cache of a core.
BLOCK = 16_000


class Triangles:
    """Triangles (m, 3, 3) mm as planes of numbers, so that many pairs are worked on without small vectors.

    corners (m, 3, 3) mm. Kept as (9, m): a corner and the two sides from it.
    """

    def __init__(self, corners):
        a = corners[:, 0]
        self._planes = np.concatenate([a.T, (corners[:, 1] - a).T, (corners[:, 2] - a).T])

    def closest(self, points, row, owner):
        """Barycentric weights (k, 3) of the point of triangle ``owner`` (k,) closest to ``points[row]``, distance (k,).

        points (n, 3) mm; row (k,) indices.
        """
        weights, distance = np.empty((len(row), 3)), np.empty(len(row))
        points = np.ascontiguousarray(np.asarray(points, dtype=float).T)
        for start in range(0, len(row), BLOCK):
            part = slice(start, start + BLOCK)
            planes = self._planes.take(owner[part], axis=1)
            off = points.take(row[part], axis=1) - planes[:3]
            _closest(off, planes[3:6], planes[6:], weights[part], distance[part])
        return weights, distance


def closest_on_triangles(p, a, b, c):
    """Barycentric weights (k, 3) of the point of triangle ``a b c`` closest to ``p``, and its distance (k,).

    All arguments (k, 3). The foot of the perpendicular where it falls inside, otherwise the best of the three sides.
    """
    weights, distance = np.empty((len(p), 3)), np.empty(len(p))
    for start in range(0, len(p), BLOCK):
        part = slice(start, start + BLOCK)
        off, ab, ac = (np.ascontiguousarray((x[part] - a[part]).T) for x in (p, b, c))
        _closest(off, ab, ac, weights[part], distance[part])
    return weights, distance


def _closest(ap, ab, ac, weights, distance):
    """Fill ``weights`` (k, 3) and ``distance`` (k,) for points ``ap`` from a corner, sides ``ab``, ``ac``; all (3, k)."""
    d11, d12, d22, e1, e2 = _dot(ab, ab), _dot(ab, ac), _dot(ac, ac), _dot(ap, ab), _dot(ap, ac)
    area = d11 * d22 - d12 * d12
    inverse = 1 / np.where(area > 0, area, 1)
    v, w = (d22 * e1 - d12 * e2) * inverse, (d11 * e2 - d12 * e1) * inverse
    rows = np.flatnonzero((v < 0) | (w < 0) | (v + w > 1) | (area <= 0))
    if len(rows):
        d11, d12, d22, e1, e2 = (x[rows] for x in (d11, d12, d22, e1, e2))
        # Squares of the distances to the three sides, all less the square of that to the corner a.
        t_ab, s_ab = _along(d11, e1)
        t_ac, s_ac = _along(d22, e2)
        t_bc, s_bc = _along(d11 - 2 * d12 + d22, e2 - e1 - d12 + d11)
        s_bc += d11 - 2 * e1
        on_ab = (s_ab <= s_bc) & (s_ab <= s_ac)
        on_bc = ~on_ab & (s_bc <= s_ac)
        v[rows] = np.where(on_ab, t_ab, np.where(on_bc, 1 - t_bc, 0))
        w[rows] = np.where(on_ab, 0, np.where(on_bc, t_bc, t_ac))
    weights[:, 0], weights[:, 1], weights[:, 2] = 1 - v - w, v, w
    gap = ap - v * ab - w * ac
    np.sqrt(_dot(gap, gap), out=distance)


def _along(length, reach):
    """Parameter 0..1 of the foot on a side of squared ``length``, and the square of the distance less the start's."""
    t = np.clip(reach / np.where(length > 0, length, 1), 0, 1)
    return t, t * (t * length - 2 * reach)


def _dot(u, v):
    out = u[0] * v[0]
    out += u[1] * v[1]
    out += u[2] * v[2]
    return out
