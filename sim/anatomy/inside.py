# SPDX-License-Identifier: GPL-3.0-or-later
"""Is a point inside a surface? The generalised winding number answers, even where the surface has holes."""

import numpy as np

from ..box_tree import morton

#: Point-triangle pairs worked on at once: few enough to stay in the cache of a core.
BUDGET = 30_000

#: Triangles in a group; a group is far from so many times its radius on; an answer this near to 1/2 is not trusted.
GROUP, FAR, DOUBT = 8, 2.5, 0.06


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
        total[start : start + chunk] = _half_angles(a, b, c).sum(axis=1)
    return total / (2 * np.pi)


def inside(points, vertices, triangles) -> np.ndarray:
    """(k,) bool: whether each of ``points`` (k, 3) lies within the mesh.

    Far groups of triangles count as one dipole each (Barill et al. 2018, equation 6); where that leaves a doubt, every
    triangle is asked.
    """
    points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    triangles = np.asarray(triangles)
    if len(triangles) < 4 * GROUP:
        return winding_number(points, vertices, triangles) > 0.5
    about = _with_dipoles(points, np.asarray(vertices, dtype=np.float64)[triangles])
    doubt = np.abs(about - 0.5) < DOUBT
    about[doubt] = winding_number(points[doubt], vertices, triangles)
    return about > 0.5


def _with_dipoles(points, corner):
    """(k,) the winding number of triangles (m, 3, 3) mm, near groups exactly and far ones as dipoles."""
    order = np.argsort(morton(corner.mean(axis=1).T), kind="stable")
    pad = -len(order) % GROUP
    order = np.concatenate([order, np.full(pad, order[-1])])
    corner = corner[order].reshape(-1, GROUP, 3, 3)
    normal = 0.5 * np.cross(corner[:, :, 1] - corner[:, :, 0], corner[:, :, 2] - corner[:, :, 0])
    if pad:
        corner[-1, GROUP - pad :] = corner[-1, GROUP - pad - 1, :1]  # of no size, so they count for nothing
        normal[-1, GROUP - pad :] = 0
    area = np.linalg.norm(normal, axis=2)
    middle = np.einsum("gt,gta->ga", area, corner.mean(axis=2)) / np.maximum(area.sum(axis=1), 1e-12)[:, None]
    radius = np.linalg.norm(corner - middle[:, None, None], axis=3).max(axis=(1, 2))
    strength = normal.sum(axis=1)
    total = np.zeros(len(points))
    for start in range(0, len(points), max(1, BUDGET * 8 // len(middle))):
        part = slice(start, start + max(1, BUDGET * 8 // len(middle)))
        gap = [middle[None, :, axis] - points[part, None, axis] for axis in range(3)]
        square = _dot(gap, gap)
        far = square > (FAR * radius) ** 2
        pull = gap[0] * strength[:, 0] + gap[1] * strength[:, 1] + gap[2] * strength[:, 2]
        total[part] = (far * pull / np.maximum(square, 1e-12) ** 1.5).sum(axis=1) / (4 * np.pi)
        i, g = np.nonzero(~far)
        for first in range(0, len(i), BUDGET // GROUP):
            pairs = slice(first, first + BUDGET // GROUP)
            to = corner[g[pairs]] - points[part][i[pairs], None, None]
            angle = _half_angles(*(to[:, :, k].transpose(2, 0, 1) for k in range(3))).sum(axis=1) / (2 * np.pi)
            total += np.bincount(start + i[pairs], angle, minlength=len(total))
    return total


def _half_angles(a, b, c):
    """Half the signed solid angle of triangles whose corners lie at a, b, c (3, ...) from the eye."""
    length_a, length_b, length_c = (np.sqrt(_dot(v, v)) for v in (a, b, c))
    volume = (
        a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    )
    cosine = length_a * length_b * length_c + _dot(a, b) * length_c + _dot(b, c) * length_a + _dot(c, a) * length_b
    return np.arctan2(volume, cosine)


def _dot(u, v):
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
