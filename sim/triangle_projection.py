# SPDX-License-Identifier: GPL-3.0-or-later
"""The closest point of a triangle, for many pairs of point and triangle at once."""

import numpy as np


def _segment(p, a, ab):
    """Parameter 0..1 of the point of segment ``a + t ab`` closest to ``p``; all (k, 3)."""
    length = np.einsum("ij,ij->i", ab, ab)
    return np.clip(np.einsum("ij,ij->i", p - a, ab) / np.where(length > 0, length, 1), 0, 1)


def closest_on_triangles(p, a, b, c):
    """Barycentric weights (k, 3) of the point of triangle ``a b c`` closest to ``p``, and its distance (k,).

    All arguments (k, 3). The foot of the perpendicular where it falls inside, otherwise the best of the three sides.
    """
    ab, ac, ap = b - a, c - a, p - a
    d11, d12, d22 = (np.einsum("ij,ij->i", u, v) for u, v in ((ab, ab), (ab, ac), (ac, ac)))
    e1, e2 = np.einsum("ij,ij->i", ap, ab), np.einsum("ij,ij->i", ap, ac)
    area = d11 * d22 - d12 * d12
    safe = np.where(area > 0, area, 1)
    v, w = (d22 * e1 - d12 * e2) / safe, (d11 * e2 - d12 * e1) / safe
    weights = np.stack([1 - v - w, v, w], axis=1)
    outside = np.flatnonzero((weights.min(axis=1) < 0) | (area <= 0))
    if len(outside):
        corner = [x[outside] for x in (a, b, c)]
        q = p[outside]
        best = np.full(len(outside), np.inf)
        for i, j in ((0, 1), (1, 2), (2, 0)):
            t = _segment(q, corner[i], corner[j] - corner[i])
            gap = q - corner[i] - t[:, None] * (corner[j] - corner[i])
            square = np.einsum("ij,ij->i", gap, gap)
            better = square < best
            best[better] = square[better]
            side = np.zeros((len(outside), 3))
            side[:, i], side[:, j] = 1 - t, t
            weights[outside[better]] = side[better]
    gap = p - weights[:, :1] * a - weights[:, 1:2] * b - weights[:, 2:] * c
    return weights, np.sqrt(np.einsum("ij,ij->i", gap, gap))
