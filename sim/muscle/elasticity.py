# SPDX-License-Identifier: GPL-3.0-or-later
"""The cosine interpolant of all three muscles and the elasticity that sharpens it (Waters 1986, 4.3 and 4.4).

The thesis writes cos(1 - D / Rs) and the like; the argument is a share of a right angle, as its figures show: no
displacement where the share left is 1, all of it where it is 0.
"""

import numpy as np


def falling(share) -> np.ndarray:
    """cos of a share of a right angle: 1 at 0, 0 from 1 on."""
    share = np.clip(share, 0.0, 1.0)
    return np.where(share < 1, np.cos(0.5 * np.pi * share), 0.0)


def elastic(factor, power: float) -> np.ndarray:
    """The interpolant raised to a power (4.4, figure 18): 1 leaves it as it is, more draws it to its peak."""
    return np.clip(factor, 0.0, 1.0) ** power
