# SPDX-License-Identifier: GPL-3.0-or-later
"""How much soft tissue covers the bone."""

import numpy as np

from ..adapt.closest import Surface
from ..anatomy.head import Head
from ..mesh import Mesh
from .enclosure import enclosed

BONES = ("skull", "mandible")
NEAR = 5.0  # mm: cover thicker than this is not measured


def bone_cover(head: Head, part: str) -> tuple[float, float, int]:
    """Least tissue, mm, over a bone: to the skin one sees, and to the lining of mouth, lids and nose; and how many of
    its vertices lie outside the skin.

    Measured from the bone's vertices and the middles of its triangles to the skin's triangles, and the other way round.
    """
    bone, skin = head.parts[part], head.skin
    lining = head.groups["inner"][skin.triangles].max(axis=1) > 0.5
    out = ~enclosed(bone, skin)
    seen, hidden = (_least(bone, skin.vertices, skin.triangles[rows]) for rows in (~lining, lining))
    return seen, hidden, int(out.sum())


def _least(bone: Mesh, vertices, triangles) -> float:
    skin = Surface(vertices, triangles)
    solid = Surface(bone.vertices, bone.triangles)
    there = skin.closest(_points(bone.vertices, bone.triangles), NEAR).distance.min()
    back = solid.closest(_points(vertices, triangles), NEAR).distance.min()
    return float(min(there, back, NEAR))


def _points(vertices, triangles):
    return np.concatenate([vertices[np.unique(triangles)], vertices[triangles].mean(axis=1)])
