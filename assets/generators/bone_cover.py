# SPDX-License-Identifier: GPL-3.0-or-later
"""Bone stays under the skin and behind the linings of mouth, nose and lids, whatever the fields that made it."""

import numpy as np
from scipy.spatial import cKDTree

from ...sim.adapt.bone_inside import keep_inside
from ...sim.adapt.skin_cover import SkinCover
from ...sim.mesh import Mesh

#: mm of tissue over bone: under the skin one sees, and behind linings.
SEEN, LINING = 1.4, 1.15


def covered(bone: Mesh, skin: Mesh, inner: np.ndarray) -> Mesh:
    """``bone`` moved, as little as smoothness allows, to where at least `SEEN` or `LINING` mm of tissue cover it.

    skin : the reference skin; inner : (n,) its group of that name. What was symmetric stays so.
    """
    moved = keep_inside(bone, SkinCover(skin, inner, LINING), np.full(len(bone.vertices), SEEN))
    mirror = cKDTree(bone.vertices).query(bone.vertices * [-1, 1, 1])[1]
    return bone.moved(0.5 * (moved + moved[mirror] * [-1, 1, 1]))
