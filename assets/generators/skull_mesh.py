# SPDX-License-Identifier: GPL-3.0-or-later
"""From the field of a bone to its mesh: fine where the face is, coarse on the vault, with sockets in its alveolar ridge."""

import numpy as np

from ...sim.mesh import Mesh
from .skull_arch import DentalArch
from .skull_nets import surface_nets
from .skull_patch import cut, evened, left_half, sewn, whole
from .skull_sockets import heights, socket_strip


def bone_mesh(field, low, high, cell: float, arch: DentalArch, far=None, coarse: float = 0.0, finer=None) -> Mesh:
    """The closed, symmetric mesh of a bone.

    Parameters
    ----------
    field : function of points (n, 3) mm -> (n,) mm, negative inside
    low, high : (3,) mm, box that holds the bone
    cell : mm, size of faces
    arch : the ridge that gets sockets
    far, coarse : function of points -> (n,) mm, positive where faces of size ``coarse`` mm will do
    finer : where faces are smaller, see `surface_nets`
    """
    half = left_half(surface_nets(field, low, high, cell, finer=finer))
    if far is not None:
        vault = left_half(surface_nets(field, low, high, coarse))
        half = cut(half, far(half.vertices) > 0)
        half, seam = sewn(half, cut(vault, far(vault.vertices) < 0.75 * coarse))
        half = evened(half, field, seam, cell, np.zeros(len(half.vertices), bool))
    half = cut(half, _ridge(half.vertices, arch, cell))
    body = len(half.vertices)
    half, seam = sewn(half, socket_strip(arch, field))
    half = evened(half, field, seam[seam < body], cell, np.arange(len(half.vertices)) >= body)
    return whole(half)


def _ridge(p, arch: DentalArch, cell):
    """(n,) bool, whether the socket strip takes the place of the bone's surface there."""
    away, tall, near = arch.local(p)
    wide = arch.half[near] + 2.4 + np.where(away > 0, 3.0, 1.0)
    return (tall < heights(arch)[-1] + 0.4 * cell) & (tall > -5.0) & (np.abs(away) < wide)
