# SPDX-License-Identifier: GPL-3.0-or-later
"""Teeth and tongue under a fitted skin: rigid crowns on the jaws' own movement, as far behind the lips as ever."""

import numpy as np
from scipy.spatial import cKDTree

from .closest import Surface
from .refine import scattered
from .rest import BONES, Rest
from .thin_plate_spline import similarity

TEETH = ("teeth_upper", "teeth_lower")
AROUND_TEETH = 28.0  # mm: bone this near carries the teeth
BEHIND_LIPS = 12.0  # mm: teeth this near to the skin have lips or cheeks over them
LIP_LEFT = 0.75  # share of that distance that must remain


def near_bone(rest: Rest, parts, points, radius):
    """Callable that carries points as the bone within ``radius`` mm of ``points`` (k, 3) moves: a similarity.

    parts : bone -> (n, 3) mm, where the bones are now
    """
    source = np.concatenate([rest.head.parts[name].vertices for name in BONES])
    target = np.concatenate([parts[name] for name in BONES])
    pick = cKDTree(points).query(source)[0] < radius
    if pick.sum() < 12:
        pick[:] = True
    matrix, shift = similarity(source[pick], target[pick])
    return lambda x: np.asarray(x) @ matrix.T + shift


def mouth_similarity(rest: Rest, parts, fitted):
    """Callable that carries teeth, gums, tongue and mouth bag.

    One similarity for both jaws, so that the teeth bite as they do on the reference.
    """
    teeth = np.concatenate([rest.head.parts[name].vertices for name in TEETH])
    with_bone = near_bone(rest, parts, teeth, AROUND_TEETH)
    teeth = teeth[scattered(teeth, 3.0)]
    before = _room_over(teeth, Surface(rest.head.skin.vertices, rest.outer))[0]
    teeth, before = teeth[before < BEHIND_LIPS], before[before < BEHIND_LIPS]
    lips = Surface(fitted, rest.outer)
    shift = np.zeros(3)
    for _ in range(4):
        after, inward = _room_over(with_bone(teeth) + shift, lips)
        lack = np.where(np.abs(after) < BEHIND_LIPS, LIP_LEFT * before - after, 0.0)
        short = float(np.percentile(lack, 98)) if len(lack) else 0.0
        if short < 0.1:
            break
        way = inward[lack > 0].mean(axis=0)
        shift = shift + short * way / max(float(np.linalg.norm(way)), 0.3)
    return lambda x: with_bone(x) + shift


def _room_over(points, skin: Surface):
    """(k,) mm from points (k, 3) out to the skin, negative outside, and (k, 3) the way in."""
    found = skin.closest(points)
    height = np.einsum("ij,ij->i", found.points - points, found.normals)
    return np.where(height < 0, -found.distance, found.distance), -found.normals
