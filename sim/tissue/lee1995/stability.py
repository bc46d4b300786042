# SPDX-License-Identifier: GPL-3.0-or-later
"""How long a step of explicit Euler may be.

For one mode of stiffness k the scheme of 3.9 stays bounded while 4 - 2 gamma dt / m - dt² k / m > 0. The largest k of a mesh
is not above its largest row sum (Gershgorin): twice the springs at a node, and the other forces there.
"""

import numpy as np

from ..structures import Springs
from .constants import Constants
from .structures import Elements


def stiffest(
    springs: Springs, elements: Elements, area: np.ndarray, restoration: np.ndarray, constants: Constants
) -> float:
    """g/s², an upper bound of the stiffness that any mode meets.

    area : (t,) mm² of the elements' epidermis; restoration : (3 n,) g/s²
    """
    count = springs.difference.shape[1]
    steep = np.maximum(springs.stiffness, springs.stiff)
    row = 2 * (np.bincount(springs.first, steep, count) + np.bincount(springs.second, steep, count))
    row += 2 * constants.shape * elements.about.diagonal()
    n = elements.epidermal.shape[0]
    # k1 dV/dx over the element's six nodes: a third of the area each, and as much again for motion along the skin
    row[:n] += 4 * constants.volume * (elements.epidermal @ area)
    return float((row + restoration).max())


def stable_step(stiffness: float, constants: Constants, margin: float = 0.8) -> float:
    """s: the paper's step, or ``margin`` of the longest that is stable with ``stiffness`` g/s² where that is shorter."""
    a, b = stiffness / constants.mass, 2 * constants.damping / constants.mass
    longest = (np.sqrt(b * b + 16 * a) - b) / (2 * a)
    return float(min(constants.time_step, margin * longest))
