# SPDX-License-Identifier: GPL-3.0-or-later
"""Volume preservation: Lee, Terzopoulos and Waters 1995, 3.6.

The paper pushes epidermal nodes along their normal by k1 (V - V_rest). Here the same pressure k1 (V - V_rest) /
V_rest is the derivative of an energy, so it acts on all six nodes along the gradient of the volume and its momentum
is zero. What the paper's k2 term does (keep the prism's shape about its centre of mass) the crossed diagonals do.
"""

import numpy as np
from scipy import sparse

from .axes import per_axis


def volumes_and_gradients(positions: np.ndarray, prisms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Volumes (t,) mm³ of prisms (t, 6), positive when the right way round, and their gradients (6, 3, t).

    The sides are ruled surfaces (their volume is the mean of both ways to split each quad), so a section parallel to the
    triangles has edges that change linearly from the one triangle, a, to the other, b. With the edges e, f of each, and
    D the sum of the three connecting vectors, the integral over the sections is V = - D · N / 6,
    N = [e_a x f_a + e_b x f_b + (e_a + e_b) x (f_a + f_b)] / 6.
    """
    e, f, normal, through = _sections(np.ascontiguousarray(positions.T), prisms)
    grad = np.empty((3, 2, 3, len(prisms)))
    volume = _volume(normal, through)
    _at_corners(e, f, normal, through, grad)
    return volume, grad.reshape(3, 6, -1).transpose(1, 0, 2)


def _sections(x: np.ndarray, prisms: np.ndarray):
    """Of prisms (t, 6) of ``x`` (3, k) mm, axis by axis: 2 e_a + e_b and e_a + 2 e_b (3, 2, t), the same of f, 6 N (3, t) and
    - D / 36 (3, t)."""
    # mode="clip" writes without a buffer; no index is out of range
    p = x.take(prisms.T, axis=1, mode="clip").reshape(3, 2, 3, -1)  # axis, triangle (a, b), corner, prism
    e, f = p[:, :, 1] - p[:, :, 0], p[:, :, 2] - p[:, :, 0]
    sums = p[:, :, 0] + p[:, :, 1]
    sums += p[:, :, 2]
    through = sums[:, 0] - sums[:, 1]
    through /= 36
    e_both, f_both, each = e[:, 0] + e[:, 1], f[:, 0] + f[:, 1], _cross(e, f)
    normal = _cross(e_both, f_both)
    normal += each[:, 0]
    normal += each[:, 1]
    e += e_both[:, None]
    f += f_both[:, None]
    return e, f, normal, through


def _volume(normal, through):
    """(t,) mm³, of `_sections`."""
    return normal[0] * through[0] + normal[1] * through[1] + normal[2] * through[2]


def _at_corners(e, f, normal, through, out):
    """Gradients of the volumes (3, 2, 3, t) into ``out``, of `_sections`; ``normal`` is changed."""
    through = through[:, None]
    _cross(f, through, out[:, :, 1])
    _cross(through, e, out[:, :, 2])
    np.add(out[:, :, 1], out[:, :, 2], out=out[:, :, 0])
    np.negative(out[:, :, 0], out=out[:, :, 0])
    normal /= 36
    normal = normal[:, None]
    out[:, 0] += normal
    out[:, 1] -= normal


def _cross(a: np.ndarray, b: np.ndarray, out=None) -> np.ndarray:
    """(3, ...), of the vectors along the first axis of a and b."""
    out = np.empty(np.broadcast(a, b).shape, a.dtype) if out is None else out
    np.subtract(a[1] * b[2], a[2] * b[1], out=out[0])
    np.subtract(a[2] * b[0], a[0] * b[2], out=out[1])
    np.subtract(a[0] * b[1], a[1] * b[0], out=out[2])
    return out


def prism_volumes(positions: np.ndarray, prisms: np.ndarray) -> np.ndarray:
    """(t,) mm³ of prisms (t, 6): epidermis triangle, then the fascia triangle below it."""
    return _volume(*_sections(np.ascontiguousarray(positions.T), prisms)[2:])


def corner_gather(prisms: np.ndarray, count: int) -> sparse.csr_matrix:
    """Sparse (count, 6 t) that sums prism corners (corner-major) into nodes."""
    k = prisms.size
    return sparse.csr_matrix((np.ones(k), (prisms.T.ravel(), np.arange(k))), (count, k))


def volume_forces(x, prisms, rest_volume, k1, crushed=0.0, hardening=0.0, out=None) -> tuple[float, np.ndarray]:
    """Energy ½ k1 Σ (V - V_rest)² / V_rest and what it does to each corner (3, 6 t), corner-major; ``x`` (3, k) mm.

    A prism with less than the share ``crushed`` of its volume resists ``hardening`` times more: 3.6 alone has no way to keep
    a prism in a deep fold from turning inside out.
    """
    e, f, normal, through = _sections(x, prisms)
    volume = _volume(normal, through)
    missing = np.maximum(crushed * rest_volume - volume, 0)
    volume -= rest_volume
    pressure = k1 * volume / rest_volume
    resistance = hardening * k1 * missing / rest_volume
    energy = 0.5 * float(pressure @ volume + resistance @ missing)
    pressure -= resistance
    normal *= pressure
    through *= pressure
    out = np.empty((3, prisms.size), x.dtype) if out is None else out
    _at_corners(e, f, normal, through, out.reshape(3, 2, 3, -1))
    return energy, out


def volume_energy(positions, prisms, rest_volume, k1, gather) -> tuple[float, np.ndarray]:
    """Energy ½ k1 Σ (V - V_rest)² / V_rest and its gradient (nodes, 3)."""
    energy, force = volume_forces(np.ascontiguousarray(positions.T), prisms, rest_volume, k1)
    return energy, per_axis(gather, force).T
