# SPDX-License-Identifier: GPL-3.0-or-later
"""The triangles of a depth map that are stretched over its jumps, from an ear to the wall behind it, and show no surface."""

import numpy as np

from ..mesh import cross_sides

LONG = 6.0  # times the median side of the scan's triangles: a stretched one is longer
THIN = 0.2  # of its longest side: a stretched one is no higher
#: Shares of the area and of the triangles from which on it is a depth map. Heads from other sources have up to .007 and .0012
#: of such triangles, one drawn as a depth map .62 and .034.
AREA, COUNT = 0.03, 0.004


def depth_jumps(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(m,) bool: the stretched ones of the triangles (m, 3) over vertices (n, 3) in any unit; none, if it is no depth map."""
    planes = np.ascontiguousarray(np.asarray(vertices, dtype=float).T)
    a, b, c = (planes.take(triangles[:, k], axis=1) for k in range(3))
    double = np.sqrt((cross_sides(a, b, c) ** 2).sum(axis=0))
    sides = np.sqrt([((q - p) ** 2).sum(axis=0) for p, q in ((a, b), (b, c), (c, a))])
    longest = sides.max(axis=0)
    jumps = (longest > LONG * np.median(sides)) & (double < THIN * longest**2)
    if double[jumps].sum() < AREA * double.sum() or jumps.mean() < COUNT:
        jumps[:] = False
    return jumps
