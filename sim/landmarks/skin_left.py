# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a scan is skin, as the plausible head laid on it tells: without what the lips hold, and without hair."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from ..adapt.closest import Surface
from .hair_rim import rim_of_hair
from .held_by_lips import held_by_lips
from .hidden_skin import EARLESS
from .laid_head import LaidHead
from .under_hair import hair_over, in_face

BESIDE_FACE = 11.0  # mm from the face's outline: what lies within and may be skin is as scanned


@dataclass(frozen=True, eq=False)
class SkinLeft:
    """surface : the scan without all that is no skin; held (k, 3) mm : where the lips hold something; held_area, hair_area :
    mm² of that and of hair, without a fringe; covered (n,) bool : the points of the skin under hair that was left out."""

    surface: Surface
    held: np.ndarray
    held_area: float
    hair_area: float
    covered: np.ndarray


def skin_left(head: LaidHead, given: dict[str, np.ndarray], leave_out: Collection[str]) -> SkinLeft:
    """What of the ``head``'s target is skin. given : name -> (3,) mm, landmarks; leave_out : of `NO_SKIN`."""
    space, target, hair, without_hair = head.space, head.target, head.hair, "hair" in leave_out
    held, covered = (np.zeros(len(each), dtype=bool) for each in (target.triangles, space.points))
    if "held_by_lips" in leave_out:
        held = held_by_lips(space, head.fit, target)
    if without_hair:
        covered |= hair.covered & ~in_face(space, hair.fit, given, BESIDE_FACE)
        covered |= hair.far & ~in_face(space, hair.fit, given, 0.0)
    covered &= ~head.fringed
    shows = hair_over(space, hair.fit, target, covered)
    if without_hair:
        probably, bare = covered | hair.covered, head.fringed | (space.ear > EARLESS)
        rising, rim = rim_of_hair(space, hair.scalp, target, probably, covered, bare, given)
        shows |= rising
        covered |= rim
    areas = (float(target.area[each].sum()) for each in (held, shows))
    return SkinLeft(target.without(held | shows), target.vertices[target.triangles[held].ravel()], *areas, covered)
