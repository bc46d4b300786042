# SPDX-License-Identifier: GPL-3.0-or-later
"""Small tools for placing rings: mixing, unit vectors, even spacing along a curve."""

import numpy as np
from scipy.interpolate import CubicSpline


def lerp(a, b, t):
    """Linear mix; ``t`` (k,) goes with the rows of ``a``."""
    t = np.asarray(t, float)
    return a + (b - a) * (t[:, None] if t.ndim == 1 and np.ndim(a) == 2 else t)


def unit(v):
    """Vectors (k, 3) of length 1."""
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def even(points, count):
    """(count, d) evenly spaced points of a cubic curve through ``points``."""
    points = np.array(points, float)
    length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
    fine = CubicSpline(length, points)(np.linspace(0, length[-1], 400))
    along = np.r_[0, np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1))]
    at = np.linspace(0, along[-1], count)
    return np.stack([np.interp(at, along, fine[:, k]) for k in range(points.shape[1])], axis=1)
