# SPDX-License-Identifier: GPL-3.0-or-later
"""Is a point inside a surface? The generalised winding number answers, even where the surface has holes."""

import numpy as np

#: Point-triangle pairs worked on at once: few enough to stay in the cache of a core.
BUDGET = 30_000


def winding_number(points, vertices, triangles, budget: int = BUDGET) -> np.ndarray:
    """(k,) generalised winding number of a triangle mesh: about 1 inside, 0 outside.

    The sum of the signed solid angles of all triangles over 4 pi (Jacobson, Kavan and Sorkine-Hornung 2013, equation
    5; the angle after Van Oosterom and Strackee 1983). Holes only blur the answer, so 0.5 is the threshold.

    Parameters
    ----------
    points : (k, 3) mm
    vertices : (n, 3) mm
    triangles : (m, 3) vertex indices, counter-clockwise seen from outside
    budget : point-triangle pairs per chunk
    """
    points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    corner = np.asarray(vertices, dtype=np.float64)[np.asarray(triangles)]
    total = np.zeros(len(points))
    if len(corner) == 0:
        return total
    chunk = max(1, budget // len(corner))
    for start in range(0, len(points), chunk):
        query = points[start : start + chunk]
        # One array per corner and axis: nine planes are faster than one block of 3-vectors.
        a, b, c = ([corner[None, :, k, axis] - query[:, axis, None] for axis in range(3)] for k in range(3))
        length_a, length_b, length_c = (np.sqrt(_dot(v, v)) for v in (a, b, c))
        volume = (
            a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
        )
        cosine = length_a * length_b * length_c + _dot(a, b) * length_c + _dot(b, c) * length_a + _dot(c, a) * length_b
        total[start : start + chunk] = np.arctan2(volume, cosine).sum(axis=1)
    return total / (2 * np.pi)


def inside(points, vertices, triangles) -> np.ndarray:
    """(k,) bool: whether each of ``points`` (k, 3) lies within the mesh."""
    return winding_number(points, vertices, triangles) > 0.5


def _dot(u, v):
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
