# SPDX-License-Identifier: GPL-3.0-or-later
"""Stray vertices: single ones so far off that the faces at them are needles, which a scanner or a bad number made."""

import numpy as np

#: Share of the vertices at either end, along each axis, that may lie beside the bulk of a scan.
BESIDE = 0.05
#: A needle is so many times as long as the bulk is wide. The longest faces of busts, of walls behind a head and of decimated
#: scans are once to twice; a wall may be far off, but not all the faces at a vertex of it are needles.
FAR = 3.0
SLENDER = 0.1  # width of a needle over its length, at most
PLENTY = 200_000  # vertices that tell how wide the bulk is


def stray_vertices(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(n,) bool of ``points`` (n, 3), in any unit: those at which all of ``triangles`` (m, 3), welded, are needles that end
    there."""
    stray = np.zeros(len(points), dtype=bool)
    if not len(points):
        return stray
    low, high = np.quantile(points[:: 1 + len(points) // PLENTY], (BESIDE, 1 - BESIDE), axis=0)
    far = FAR * (high - low).max()
    if not np.ptp(points, axis=0).max() > far > 0:
        return stray
    a, b, c = (points[triangles[:, k]] for k in range(3))
    sides = np.stack([np.abs(edge).max(axis=1) for edge in (c - b, a - c, b - a)], axis=1)  # opposite each corner
    longest, shortest = sides.max(axis=1), sides.min(axis=1)
    needle = (longest > far) & (shortest < SLENDER * longest)
    tip = triangles[np.arange(len(triangles)), sides.argmin(axis=1)]
    ends = np.bincount(tip[needle], minlength=len(points))
    stray[:] = (ends > 0) & (ends == np.bincount(triangles.ravel(), minlength=len(points)))
    return stray
