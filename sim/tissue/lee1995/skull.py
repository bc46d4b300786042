# SPDX-License-Identifier: GPL-3.0-or-later
"""Skull penetration constraint forces: Lee, Terzopoulos and Waters 1995, 3.7.

s_i = -(f_i^n · n_i) n_i where the net force on a fascia node points into the skull, so that the node slides over it. The
paper's skull is an offset of the skin and its fascia lies on it; here the skull is a mesh of its own, so a force is
cancelled where the fascia has come down on it. In steps of finite length a node would still coast into the bone with
the speed that it has: `arrested` takes away what of its velocity would carry it past the surface.

The same rule keeps skin off teeth and eyeballs, and, shared between two nodes, the lips off each other and the lining of
the mouth inside the cheek, none of which the paper has.
"""

import numpy as np

from ..planes import Planes

#: mm over a surface at which a node lies on it.
TOUCH = 0.05
#: Share of what a node is inside a surface that it is brought out by in one step.
_OUT = 0.1


def heights(planes: Planes, positions: np.ndarray) -> np.ndarray:
    """(c,) mm of each node over its plane; negative inside."""
    return _along(planes, positions) - planes.level


def skull_forces(planes: Planes, positions: np.ndarray, force: np.ndarray) -> np.ndarray:
    """(k, 3) s of all nodes, given the net force (k, 3) on each."""
    into = np.minimum(_along(planes, force), 0) * (heights(planes, positions) <= TOUCH)
    return _shared(planes, -into, len(force))


def arrested(planes: Planes, positions: np.ndarray, velocities: np.ndarray, dt: float) -> np.ndarray:
    """Velocities (k, 3) mm/s with which no node passes its plane within ``dt``, and one inside comes out again."""
    height = heights(planes, positions)
    least = -np.where(height > 0, height, _OUT * height) / dt
    return velocities + _shared(planes, np.maximum(least - _along(planes, velocities), 0), len(velocities))


def _along(planes, values):
    """(c,) of ``values`` (k, 3): along the normal, against the partner where there is one."""
    out = np.einsum("ij,ij->i", values[planes.node], planes.normal)
    paired = planes.partner >= 0
    if paired.any():
        out[paired] -= np.einsum("ij,ij->i", values[planes.partner[paired]], planes.normal[paired])
    return out


def _shared(planes, amount, count):
    """(count, 3): ``amount`` (c,) along each normal, half of it to a partner, the mean where several act on a node."""
    act = np.flatnonzero(amount)
    out = np.zeros((count, 3))
    if not len(act):
        return out
    paired = planes.partner[act] >= 0
    push = (np.where(paired, 0.5, 1.0) * amount[act])[:, None] * planes.normal[act]
    nodes = np.concatenate([planes.node[act], planes.partner[act][paired]])
    push = np.concatenate([push, -push[paired]])
    several = np.maximum(np.bincount(nodes, minlength=count), 1)
    for axis in range(3):
        out[:, axis] = np.bincount(nodes, push[:, axis], minlength=count) / several
    return out
