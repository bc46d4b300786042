# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors kept axis by axis, (3, n) instead of (n, 3): what is done to all of them runs several times faster so."""

import numpy as np


def per_axis(matrix, x: np.ndarray) -> np.ndarray:
    """(3, m): a sparse ``matrix`` (m, n) applied to each row of ``x`` (3, n)."""
    out = np.empty((3, matrix.shape[0]), np.result_type(matrix.dtype, x.dtype))
    for k in range(3):
        out[k] = matrix @ x[k]
    return out
