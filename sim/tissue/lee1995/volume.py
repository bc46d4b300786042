# SPDX-License-Identifier: GPL-3.0-or-later
"""Volume preservation forces: Lee, Terzopoulos and Waters 1995, 3.6.

q_i^e = k1 (V^e - V~^e) n_i^e + k2 (p_i^e - p~_i^e) stands on the left of 3.8, so the force on a node is -q: a squeezed
element pushes its epidermal nodes out along their normals (the epidermis alone, as in the paper: the net of that is not
zero), and a bent one pulls its nodes to where they were about its centre of mass. The rest coordinates p~ are turned by as
much of the jaw's rotation as the element's place takes part in, or the chin would be bent back; by no more: a p~ that
follows the element wherever it turns would be as content with one turned inside out.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from .constants import Constants
from .structures import Elements


def measured(positions: np.ndarray, prisms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Volumes (t,) mm³ of prisms (t, 6), and their epidermal triangles' normals (t, 3), twice as long as their area.

    The sides are ruled surfaces, the same as the mean of both ways to split each (`tissue.volume`): with edges u, v of a
    triangle between both faces the volume is the integral of u x v · H over the height H.
    """
    a, b, c, d, e, f = np.take(positions, prisms.T, axis=0)
    u, v, under_u, under_v = b - a, c - a, e - d, f - d
    above, below = _cross(u, v), _cross(under_u, under_v)
    height = (a + b + c - d - e - f) / 3
    between = above + below + _cross(u + under_u, v + under_v)
    return np.einsum("ij,ij->i", height, between) / 12, above


def turned_rest(elements: Elements, rest: np.ndarray, share: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """(3 n, 3) mm: the sum of p~ over the elements at each node, turned with the jaw.

    rest : (3 n, 3) mm; share (n,) of the jaw's ``rotation`` (3, 3) that each column takes part in
    """
    if not len(elements.prisms):
        return np.zeros_like(rest)
    corners = rest[elements.prisms]
    about = corners - corners.mean(axis=1, keepdims=True)
    turn = Rotation.from_matrix(rotation).as_rotvec() * share[elements.prisms[:, :3]].mean(axis=1)[:, None]
    about = np.einsum("tij,tcj->cti", Rotation.from_rotvec(turn).as_matrix(), about)
    return elements.gather @ about.reshape(-1, 3)


def volume_forces(elements: Elements, positions: np.ndarray, rest: np.ndarray, constants: Constants) -> np.ndarray:
    """(3 n, 3) the sum of -q over the elements at each node; ``rest`` (3 n, 3) from `turned_rest`."""
    n = elements.epidermal.shape[0]
    force = constants.shape * (rest - elements.about @ positions)
    volume, face = measured(positions, elements.prisms)
    push, normal = np.split(elements.epidermal @ np.column_stack([volume - elements.volume, face]), [1], axis=1)
    size = np.sqrt(np.einsum("ij,ij->i", normal, normal))[:, None]
    force[:n] -= constants.volume * push * normal / np.maximum(size, 1e-12)
    return force


def _cross(a, b):
    out = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.subtract(a[:, j] * b[:, k], a[:, k] * b[:, j], out=out[:, i])
    return out
