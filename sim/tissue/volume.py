# SPDX-License-Identifier: GPL-3.0-or-later
"""Volume preservation: Lee, Terzopoulos and Waters 1995, 3.6.

The paper pushes epidermal nodes along their normal by k1 (V - V_rest). Here the same pressure k1 (V - V_rest) /
V_rest is the derivative of an energy, so it acts on all six nodes along the gradient of the volume and its momentum
is zero. What the paper's k2 term does (keep the prism's shape about its centre of mass) the crossed diagonals do.
"""

import numpy as np
from scipy import sparse


def volumes_and_gradients(positions: np.ndarray, prisms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Volumes (t,) mm³ of prisms (t, 6), positive when the right way round, and their gradients (6, 3, t).

    The sides are ruled surfaces (their volume is the mean of both ways to split each quad), so a section parallel to the
    triangles has edges that change linearly from the one triangle, a, to the other, b. With the edges e, f of each, and
    D the sum of the three connecting vectors, the integral over the sections is V = - D · N / 6,
    N = [e_a x f_a + e_b x f_b + (e_a + e_b) x (f_a + f_b)] / 6.
    """
    p = positions.T[:, prisms.T]  # (3, 6, t)
    e_a, f_a, e_b, f_b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], p[:, 4] - p[:, 3], p[:, 5] - p[:, 3]
    e, f = e_a + e_b, f_a + f_b
    through = p[:, 3] + p[:, 4] + p[:, 5] - p[:, 0] - p[:, 1] - p[:, 2]
    normal = (_cross(e_a, f_a) + _cross(e_b, f_b) + _cross(e, f)) / -36
    volume = np.einsum("ij,ij->j", normal, through)
    grad = np.empty((6, 3, len(prisms)))
    scaled = through / -36
    grad[1], grad[2] = _cross(f_a + f, scaled), _cross(scaled, e_a + e)
    grad[4], grad[5] = _cross(f_b + f, scaled), _cross(scaled, e_b + e)
    np.subtract(-normal, grad[1] + grad[2], out=grad[0])
    np.subtract(normal, grad[4] + grad[5], out=grad[3])
    grad[1:3] -= normal
    grad[4:6] += normal
    return volume, grad


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(3, t), of the columns of a and b (3, t)."""
    out = np.empty_like(a)
    np.subtract(a[1] * b[2], a[2] * b[1], out=out[0])
    np.subtract(a[2] * b[0], a[0] * b[2], out=out[1])
    np.subtract(a[0] * b[1], a[1] * b[0], out=out[2])
    return out


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
