# SPDX-License-Identifier: GPL-3.0-or-later
"""Smooth random fields in space, reproducible from a generator."""

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter

CELLS = 24


class Noise:
    """A smooth, endlessly repeating random function of position with zero mean and unit deviation.

    Random numbers on a lattice of ``size`` mm, cubic B-splines between them.
    """

    def __init__(self, rng: np.random.Generator, size: float):
        self.size = size
        self.coefficients = spline_filter(rng.standard_normal((CELLS, CELLS, CELLS)), order=3, mode="grid-wrap")

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """(n,) values at points (n, 3) mm."""
        at = (np.asarray(points, dtype=float) / self.size).T % CELLS
        # cubic interpolation between lattice points loses some variance: 0.82 is what is left of the deviation
        return map_coordinates(self.coefficients, at, order=3, mode="grid-wrap", prefilter=False) / 0.82
