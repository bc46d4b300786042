# SPDX-License-Identifier: GPL-3.0-or-later
"""Muscles lie between skin and bone."""

import numpy as np

from ..adapt.bone import depth_under
from ..adapt.closest import Surface
from ..anatomy.head import Head
from .bone import BONES

NEAR = 15.0
SLACK = 0.3  # mm: bellies rest on bone, so less than this inside it is no fault
TOUCH = 0.05  # mm: the same for the skin and the lining of the mouth


def muscle_room(head: Head) -> dict[str, tuple[float, float]]:
    """Muscle -> how far, mm, its belly comes out of the skin (or into the mouth) and how deep it dips into bone.

    Muscles that stay in their room are left out.
    """
    points = np.concatenate([m.shape.vertices for m in head.muscles])
    owner = np.repeat(np.arange(len(head.muscles)), [len(m.shape.vertices) for m in head.muscles])
    depth = depth_under(points, Surface(head.skin.vertices, head.skin.triangles), NEAR)[0]
    out = np.maximum(-depth, 0)
    dip = np.zeros(len(points))
    for part in BONES:
        bone = Surface(head.parts[part].vertices, head.parts[part].triangles)
        deep, found = depth_under(points, bone, NEAR)
        dip = np.maximum(dip, np.where(found.found, deep, 0))
    worst = [(float(out[owner == k].max()), float(dip[owner == k].max())) for k in range(len(head.muscles))]
    return {m.name: w for m, w in zip(head.muscles, worst, strict=True) if w[0] > TOUCH or w[1] > SLACK}
