# SPDX-License-Identifier: GPL-3.0-or-later
"""Spring forces: Lee, Terzopoulos and Waters 1995, 3.3.

g_j = c_j (l_j - l_j^r) s_j is the force that spring j exerts on its node i, toward its other end. c_j is a constant of the
layer; in the dermal-fatty layer it is biphasic: skin gives way easily until its collagen is stretched. The springs
are those of `tissue.springs`, whose energy these forces are the gradient of.
"""

import numpy as np

from ..structures import Springs


def tension(springs: Springs, length: np.ndarray) -> np.ndarray:
    """(s,) c (l - l_rest) of each spring at ``length`` (s,) mm; continuous where the second phase begins."""
    stretch = length - springs.rest
    beyond = np.maximum(stretch - springs.limit * springs.rest, 0)
    return springs.stiffness * stretch + (springs.stiff - springs.stiffness) * beyond


def spring_forces(springs: Springs, positions: np.ndarray) -> np.ndarray:
    """(k, 3) the sum of g_j over the springs at each node."""
    way = springs.difference @ positions
    length = np.sqrt(np.einsum("ij,ij->i", way, way))
    way *= (tension(springs, length) / np.maximum(length, 1e-9))[:, None]
    return -(springs.gather @ way)
