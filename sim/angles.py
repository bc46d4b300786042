# SPDX-License-Identifier: GPL-3.0-or-later
"""Angles that come out the same wherever their arrays lie in memory."""

import numpy as np


def bearing(across, ahead) -> np.ndarray:
    """(...) rad from ahead towards across, -pi..pi: `numpy.arctan2` of two arrays (...), each copied together first.

    NumPy has a vectorised `arctan2` and one that takes number by number, which differ in the last digit. It takes the second
    where input and output might overlap, and columns of a table are counted to reach past its end: with an output that
    chanced to be allocated right behind it, the same points would get other angles.
    """
    return np.arctan2(np.array(across), np.array(ahead))
