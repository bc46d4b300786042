# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin does not pass the skull: a force inside the equations of motion (Kähler et al. 2002, 4.2), with no search: the
skull is only used while the structure is set up (section 3).

Each vertex on bone keeps the tangent plane of the bone under it. Nearer than its margin m it is pushed off by
k (m - h) m / max(h, m/8): soft where it begins, eight times as stiff on the bone.
The energy is its integral.
"""

import numpy as np

from ..structures import Layers
from .structures import Skull

_HARD = 8.0
#: Cosine between skin and the bone under it below which the bone lies beside it, not under it.
_LEVEL = 0.7


def build_skull(layers: Layers, normals, margin: float, stiffness_area: float) -> Skull:
    """The planes under the bony columns that move; ``normals`` (n, 3) of the skin, which must lie about level over them."""
    n = len(layers.area)
    level = np.einsum("ij,ij->i", layers.bone_normal, normals) > _LEVEL
    node = np.flatnonzero(layers.bony & layers.free[:n] & level)
    point, normal = layers.nodes[2 * n :][node], layers.bone_normal[node]
    height = np.einsum("ij,ij->i", layers.nodes[:n][node] - point, normal)
    return Skull(
        node=node,
        point=point,
        normal=normal,
        share=layers.mandible[node],
        margin=np.minimum(margin, 0.5 * np.maximum(height, 1e-3)),
        stiffness=stiffness_area * layers.area[node],
    )


def heights(positions, skull: Skull, rotation, translation) -> tuple[np.ndarray, np.ndarray]:
    """(b,) mm over the bone and the normals (b, 3), with the mandible carried by rotation (3, 3) and translation."""
    share = skull.share[:, None]
    point = skull.point + share * (skull.point @ rotation.T + translation - skull.point)
    normal = np.where(share > 0.5, skull.normal @ rotation.T, skull.normal)
    return np.einsum("ij,ij->i", positions[skull.node] - point, normal), normal


def push(height, margin, stiffness) -> tuple[np.ndarray, np.ndarray]:
    """Energy (b,) and force (b,) along the normal of vertices ``height`` mm over the bone."""
    h, m, k = (np.asarray(x, float) for x in (height, margin, stiffness))
    near = np.maximum(m - h, 0)
    floor = m / _HARD
    top = np.maximum(h, floor)
    force = k * near * m / top
    # the integral of k m (m - h) / h down to the floor, then of k (m - h) m / floor
    soft = np.where(near > 0, k * m * (m * np.log(m / np.minimum(top, m)) - (m - np.minimum(top, m))), 0.0)
    below = np.maximum(floor - h, 0)
    hard = k * m / floor * ((m - floor) * below + 0.5 * below**2)
    return soft + hard, force


def skull_energy(positions, skull: Skull, rotation, translation) -> tuple[float, np.ndarray]:
    """Energy and its gradient over ``positions`` (n, 3) or more."""
    height, normal = heights(positions, skull, rotation, translation)
    energy, force = push(height, skull.margin, skull.stiffness)
    gradient = np.zeros_like(positions)
    gradient[skull.node] = -force[:, None] * normal
    return float(energy.sum()), gradient
