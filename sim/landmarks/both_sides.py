# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaussian processes on a head whose left and right go together."""

import numpy as np

MIRROR = np.array([-1.0, 1.0, 1.0])


def near(a: np.ndarray, b: np.ndarray, reach: float) -> np.ndarray:
    """(j, k) 0..1: how near ``a`` (j, 3) and ``b`` (k, 3) mm are, a bell ``reach`` mm wide."""
    apart = np.maximum((a * a).sum(axis=1)[:, None] + (b * b).sum(axis=1) - 2 * a @ b.T, 0)
    return np.exp(-apart / (2 * reach**2))


def alike(a: np.ndarray, b: np.ndarray, reach: float, both: float) -> np.ndarray:
    """(j, k) covariance between places ``a`` (j, 3) and ``b`` (k, 3) mm of the reference, as a share of the variance far from
    the middle, of what goes together for ``reach`` mm, and with its mirror image by ``both``, -1..1."""
    return near(a, b, reach) + both * near(a, b * MIRROR, reach)
