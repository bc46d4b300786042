# SPDX-License-Identifier: GPL-3.0-or-later
"""Level rays from a vertical axis against triangles: the farthest hit of each, exactly."""

import numpy as np

from ..angles import bearing

#: Triangles and triangle-ray pairs looked at at once: they bound the memory.
BLOCK, BATCH = 400_000, 1_500_000


def outermost(local, triangles, first, step, width, top, rise, height):
    """The farthest triangle along each ray.

    local (n, 3) mm with the axis as third coordinate; ray (i, j) runs at height ``top - rise i`` in the direction
    ``(sin a, -cos a)`` with ``a = first + step j``, the ``width`` columns going all the way round.

    Returns radius (h, w) mm (0 where nothing is), triangle (h, w) int32 (-1), barycentric weights (h, w, 3) and the sine
    of the angle between ray and surface (h, w).
    """
    radius = np.zeros(width * height)
    which = np.full(width * height, -1, dtype=np.int32)
    weights = np.zeros((width * height, 3))
    slope = np.zeros(width * height)
    longitude = bearing(local[:, 0], -local[:, 1])
    row = (top - local[:, 2]) / rise
    for start in range(0, len(triangles), BLOCK):
        corner = triangles[start : start + BLOCK]
        low, count, size = _boxes(longitude[corner], row[corner], first, step, width, height)
        use = np.flatnonzero(size > 0)
        total = np.cumsum(size[use])
        begin = 0
        while begin < len(use):
            reach = (total[begin - 1] if begin else 0) + BATCH
            end = max(begin + 1, int(np.searchsorted(total, reach, side="right")))
            chosen = use[begin:end]
            hit = _hits(local, corner, chosen, size[chosen], low, count, first, step, width, top, rise)
            _keep(hit, start, radius, which, weights, slope)
            begin = end
    shape = (height, width)
    return radius.reshape(shape), which.reshape(shape), weights.reshape(*shape, 3), slope.reshape(shape)


def _boxes(longitude, row, first, step, width, height):
    """First texel (t, 2: row, column), columns (t,) and number of texels (t,) that each triangle can cover."""
    # A triangle that does not hold the axis spans less than half a turn, measured from its first corner.
    turn = longitude - longitude[:, :1]
    turn -= 2 * np.pi * np.rint(turn / (2 * np.pi))
    left, right = turn.min(axis=1), turn.max(axis=1)
    about = right - left >= np.pi * (1 - 1e-9)
    from_column = (longitude[:, 0] + left - first) / step
    to_column = (longitude[:, 0] + right - first) / step
    c0 = np.ceil(from_column - 1e-9).astype(np.int64)
    columns = np.floor(to_column + 1e-9).astype(np.int64) - c0 + 1
    c0[about], columns[about] = 0, width
    r0 = np.maximum(np.ceil(row.min(axis=1) - 1e-9), 0).astype(np.int64)
    r1 = np.minimum(np.floor(row.max(axis=1) + 1e-9), height - 1).astype(np.int64)
    columns = np.minimum(columns, width)
    size = np.maximum(columns, 0) * np.maximum(r1 - r0 + 1, 0)
    return np.column_stack([r0, c0]), columns, size


def _hits(local, corner, chosen, size, low, count, first, step, width, top, rise):
    """Rays that meet the chosen triangles: texel, radius, triangle, weights, sine of the angle of incidence."""
    of = np.repeat(chosen, size)
    at = np.arange(len(of)) - np.repeat(np.cumsum(size) - size, size)
    i, j = low[of, 0] + at // count[of], low[of, 1] + at % count[of]
    angle = first + step * j
    direction = np.column_stack([np.sin(angle), -np.cos(angle)])
    a, b, c = (local[corner[of, k]] for k in range(3))
    # Crossed with the ray's direction the plane problem is two-dimensional: sideways and up.
    side = np.column_stack([direction[:, 1], -direction[:, 0]])
    u = np.stack([np.einsum("ij,ij->i", p[:, :2], side) for p in (a, b, c)])
    v = np.stack([p[:, 2] for p in (a, b, c)]) - (top - rise * i)
    w0 = u[1] * v[2] - u[2] * v[1]
    w1 = u[2] * v[0] - u[0] * v[2]
    w2 = u[0] * v[1] - u[1] * v[0]
    total = w0 + w1 + w2
    edge = -1e-9 * np.abs(total)
    sign = np.sign(total)
    inside = (sign != 0) & (w0 * sign >= edge) & (w1 * sign >= edge) & (w2 * sign >= edge)
    keep = np.flatnonzero(inside)
    weights = np.stack([w0[keep], w1[keep], w2[keep]], axis=1) / total[keep, None]
    corners = np.stack([a[keep], b[keep], c[keep]], axis=1)
    along = np.einsum("ij,ijk,ik->i", weights, corners[..., :2], direction[keep])
    out = along > 0
    keep, weights, along, corners = keep[out], weights[out], along[out], corners[out]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.maximum(np.linalg.norm(normal, axis=1), 1e-30)
    sine = np.abs(np.einsum("ij,ij->i", normal[:, :2], direction[keep])) / length
    return i[keep] * width + np.mod(j[keep], width), along, of[keep], weights, sine


def _keep(hit, start, radius, which, weights, slope):
    """Let the hits compete with what is there: the farthest stays."""
    texel, along, of, share, sine = hit
    order = np.lexsort((along, texel))
    order = order[along[order] > radius[texel[order]]]  # of one texel's hits the farthest is written last
    texel = texel[order]
    radius[texel] = along[order]
    which[texel] = of[order] + start
    weights[texel] = share[order]
    slope[texel] = sine[order]
