# SPDX-License-Identifier: GPL-3.0-or-later
"""Signed distance fields to model bone with: rounded solids and smooth ways to join and carve them.

Every solid is a function of points (n, 3) in mm returning (n,) distances, negative inside. Distances of stretched
solids are approximate, exact in sign.
"""

import numpy as np
from scipy.spatial import cKDTree


def join(a, b, blend=0.0):
    """Union; ``blend`` mm rounds the crease (quadratic smooth minimum)."""
    if blend <= 0:
        return np.minimum(a, b)
    h = np.maximum(blend - np.abs(a - b), 0.0)
    return np.minimum(a, b) - h * h / (4 * blend)


def meet(a, b, blend=0.0):
    """Intersection."""
    return -join(-a, -b, blend)


def carve(a, hole, blend=0.0):
    """``a`` without ``hole``."""
    return meet(a, -hole, blend)


def ellipsoid(points, centre, radii, turn=None):
    """An ellipsoid; ``turn`` (3, 3) has its axes as rows."""
    q = points - np.asarray(centre, float)
    if turn is not None:
        q = q @ np.asarray(turn).T
    radii = np.asarray(radii, float)
    k0 = np.linalg.norm(q / radii, axis=1)
    k1 = np.linalg.norm(q / radii**2, axis=1)
    return np.where(k1 > 1e-9, k0 * (k0 - 1) / np.maximum(k1, 1e-9), -radii.min())


def tube(points, path, radius, flat=None):
    """A tube along a polyline (k, 3) with a radius at each corner; ``flat`` (axis (3,), factor) presses it thinner."""
    path, radius = np.asarray(path, float), np.broadcast_to(np.asarray(radius, float), len(path))
    if flat is not None:
        axis = np.asarray(flat[0], float) / np.linalg.norm(flat[0])
        stretch = np.eye(3) + (flat[1] - 1) * np.outer(axis, axis)
        points, path = points @ stretch, path @ stretch
    best = np.full(len(points), np.inf)
    for a, b, ra, rb in zip(path[:-1], path[1:], radius[:-1], radius[1:], strict=True):
        along = np.clip((points - a) @ (b - a) / max((b - a) @ (b - a), 1e-12), 0, 1)
        foot = a + along[:, None] * (b - a)
        best = np.minimum(best, np.linalg.norm(points - foot, axis=1) - (ra + along * (rb - ra)))
    return best


#: A plate knows its distance only this near, mm.
PLATE_REACH = 20.0


def plate(samples, thickness):
    """A thick sheet as a function of points: all within ``thickness`` (m,) mm of its sample points (m, 3)."""
    tree = cKDTree(samples)
    padded = np.append(thickness, 0.0)

    def solid(points):
        distance, near = tree.query(points, k=min(4, len(samples)), distance_upper_bound=PLATE_REACH)
        return np.minimum((distance - padded[near]).min(axis=1), PLATE_REACH)

    return solid


def turned(forward, up=(0.0, 0.0, 1.0)):
    """(3, 3) axes as rows: sideways, ``forward``, upward."""
    f = np.asarray(forward, float) / np.linalg.norm(forward)
    s = np.cross(f, up)
    s /= np.linalg.norm(s)
    return np.stack([s, f, np.cross(s, f)])


def curve(corners, count, smooth=True):
    """(count, d) points on a Catmull-Rom curve through ``corners`` (k, d), even in parameter."""
    corners = np.asarray(corners, float)
    if not smooth or len(corners) < 3:
        at = np.linspace(0, len(corners) - 1, count)
        return np.stack([np.interp(at, np.arange(len(corners)), c) for c in corners.T], axis=1)
    ends = np.vstack([2 * corners[0] - corners[1], corners, 2 * corners[-1] - corners[-2]])
    at = np.linspace(0, len(corners) - 1, count)
    i = np.minimum(at.astype(int), len(corners) - 2)
    t = (at - i)[:, None]
    p0, p1, p2, p3 = (ends[i + k] for k in range(4))
    return 0.5 * (2 * p1 + (p2 - p0) * t + (2 * p0 - 5 * p1 + 4 * p2 - p3) * t**2 + (3 * p1 - p0 - 3 * p2 + p3) * t**3)
