# SPDX-License-Identifier: GPL-3.0-or-later
"""What somebody holds between the lips, a breathing tube for one: it stands off the lips and chin, and is no skin.

A plausible head laid on the scan (`shape_fit`) gives up what no face explains; what is left standing off it there, in one
piece and that high, is held by the lips.
"""

import numpy as np

from ..adapt.closest import Surface
from .shape_fit import ShapeFit
from .shape_space import ShapeSpace
from .things import REACH, standing_off, things

#: mm, all on a head of the reference's size. Faces in 19 scans, smiling or not, stand off by up to 6.3 mm over more than
#: 40 mm²; a breathing tube by 11.5 over 500.
AROUND = 45.0  # from where the lips meet that is looked at
HIGH = 8.0  # that such a thing stands off somewhere
LEAST = 60.0  # mm² of it


def held_by_lips(space: ShapeSpace, fit: ShapeFit, target: Surface) -> np.ndarray:
    """(m,) bool: the triangles of ``target`` that show what is held between the lips, and what lies just beside."""
    size = fit.pose.scale
    mouth = space.landmarks(fit.points)["sto"]

    def about(points):
        return np.linalg.norm(points - mouth, axis=1) < AROUND * size

    near = np.flatnonzero(np.linalg.norm(target.vertices - mouth, axis=1) < (AROUND + REACH) * size)
    held = things(target, near, standing_off(space, fit, target, near, about), size, HIGH, LEAST)
    return held[target.triangles].any(axis=1)
