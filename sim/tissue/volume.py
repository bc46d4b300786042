# SPDX-License-Identifier: GPL-3.0-or-later
"""Volume preservation: Lee, Terzopoulos and Waters 1995, 3.6.

The paper pushes epidermal nodes along their normal by k1 (V - V_rest). Here the same pressure k1 (V - V_rest) /
V_rest is the derivative of an energy, so it acts on all six nodes along the gradient of the volume and its momentum
is zero. What the paper's k2 term does (keep the prism's shape about its centre of mass) the crossed diagonals do.
"""

import numpy as np
from scipy import sparse

#: The boundary of a prism (corners 0 1 2 above, 3 4 5 below), seen from outside. Its sides are ruled surfaces: the
#: mean of both ways to split each makes the volume symmetric in its corners.
_BOUNDARY = [((0, 1, 2), 1.0), ((3, 5, 4), 1.0)] + [
    (corner, 0.5)
    for i, j in ((0, 1), (1, 2), (2, 0))
    for corner in ((i, i + 3, j + 3), (i, j + 3, j), (i, i + 3, j), (i + 3, j + 3, j))
]
_PAIRS = [(i, j) for i in range(6) for j in range(i + 1, 6)]


def _coefficients() -> np.ndarray:
    """(6, 15): gradient of the volume at corner i = Σ over pairs of coefficient x (x_j cross x_k)."""
    table = np.zeros((6, len(_PAIRS)))
    for corner, weight in _BOUNDARY:
        for shift in range(3):
            i, j, k = (corner[(shift + s) % 3] for s in range(3))
            sign = 1 if j < k else -1
            table[i, _PAIRS.index((min(j, k), max(j, k)))] += sign * weight / 6
    return table


_TABLE = _coefficients()


def volumes_and_gradients(positions: np.ndarray, prisms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Volumes (t,) mm³ of prisms (t, 6), positive when the right way round, and their gradients (6, 3, t)."""
    p = positions[prisms]  # (t, 6, 3)
    p = np.ascontiguousarray((p - p.mean(axis=1, keepdims=True)).transpose(1, 2, 0))  # (6, 3, t)
    cross = np.empty((len(_PAIRS), 3, p.shape[2]))
    for row, (i, j) in enumerate(_PAIRS):
        a, b = p[i], p[j]
        cross[row, 0] = a[1] * b[2] - a[2] * b[1]
        cross[row, 1] = a[2] * b[0] - a[0] * b[2]
        cross[row, 2] = a[0] * b[1] - a[1] * b[0]
    grad = (_TABLE @ cross.reshape(len(_PAIRS), -1)).reshape(p.shape)
    return np.einsum("ijk,ijk->k", p, grad) / 3, grad


def prism_volumes(positions: np.ndarray, prisms: np.ndarray) -> np.ndarray:
    """(t,) mm³ of prisms (t, 6): epidermis triangle, then the fascia triangle below it."""
    return volumes_and_gradients(positions, prisms)[0]


def corner_gather(prisms: np.ndarray, count: int) -> sparse.csr_matrix:
    """Sparse (count, 6 t) that sums prism corners (corner-major) into nodes."""
    k = prisms.size
    return sparse.csr_matrix((np.ones(k), (prisms.T.ravel(), np.arange(k))), (count, k))


def volume_energy(positions, prisms, rest_volume, k1, gather) -> tuple[float, np.ndarray]:
    """Energy ½ k1 Σ (V - V_rest)² / V_rest and its gradient (nodes, 3)."""
    volume, grad = volumes_and_gradients(positions, prisms)
    change = volume - rest_volume
    pressure = k1 * change / rest_volume
    grad *= pressure
    return 0.5 * float(pressure @ change), gather @ grad.transpose(0, 2, 1).reshape(-1, 3)
