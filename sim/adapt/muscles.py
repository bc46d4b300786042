# SPDX-License-Identifier: GPL-3.0-or-later
"""Muscles under a fitted skin: warped with the space between skin and bone, then kept in it (Kähler 2002, 5.2, item 3)."""

import numpy as np

from ..anatomy.head import Muscle
from ..anatomy.muscle_room import Room
from ..anatomy.muscle_shape import reshaped
from .bone import depth_under
from .closest import Surface
from .rest import BONES, Rest

UNDER = 0.3  # mm between a muscle and the skin or the lining of the mouth, at least
NEAR = 8.0  # mm: what is that far from a surface needs no test


def carried_muscles(rest: Rest, parts, eyes, warp) -> tuple[Muscle, ...]:
    """The reference's muscles sent through ``warp`` (`Rest.between`) and kept between skin and bone.

    parts : name -> (n, 3) mm of skin and bones as they are now; eyes : the two `Eye`
    """
    muscles, skin = rest.head.muscles, rest.head.skin.moved(parts["skin"])
    points = np.concatenate([m.fibres.reshape(-1, 3) for m in muscles])
    cuts = np.cumsum([m.fibres.size // 3 for m in muscles])[:-1]
    fibres = np.split(kept_in_room(rest, points, warp.transform(points), parts), cuts)
    bones = [rest.head.parts[name].moved(parts[name]) for name in BONES]
    room = Room(skin, bones, rest.inner, [(eye.centre, eye.radius) for eye in eyes])
    return tuple(_renewed(m, f.reshape(m.fibres.shape), room, warp) for m, f in zip(muscles, fibres, strict=True))


def kept_in_room(rest: Rest, before, points, parts) -> np.ndarray:
    """Points (k, 3) pushed under the skin and out of bone, as far as they were on the reference (``before``, (k, 3))."""
    skin = Surface(parts["skin"], rest.head.skin.triangles)
    bones = [Surface(parts[name], rest.head.parts[name].triangles) for name in BONES]
    first = Surface(rest.head.skin.vertices, rest.head.skin.triangles)
    under = np.clip(depth_under(before, first, NEAR)[0], 0.0, UNDER)
    out = np.array(points)
    inside = []
    for name in BONES:
        bone = Surface(rest.head.parts[name].vertices, rest.head.parts[name].triangles)
        depth, found = depth_under(before, bone, NEAR)
        inside.append(np.where(found.found, np.clip(depth, 0.0, None), 0.0))
    for _ in range(3):
        for bone, rest_depth in zip(bones, inside, strict=True):
            depth, found = depth_under(out, bone, NEAR)
            _push(out, found, np.where(found.found, depth - rest_depth, 0.0), depth > 0)
        depth, found = depth_under(out, skin, NEAR)
        _push(out, found, np.where(found.found, under - depth, 0.0), depth < 0)
    return out


def _push(points, found, lack, toward):
    """Move points that lack room toward their contact (``toward``) or away from it, in place."""
    rows = np.flatnonzero(lack > 1e-3)
    way = (found.points - points)[rows] * np.where(toward[rows], 1.0, -1.0)[:, None]
    length = np.linalg.norm(way, axis=1, keepdims=True)
    points[rows] += lack[rows, None] * way / np.maximum(length, 1e-6)


def _renewed(muscle: Muscle, fibres, room: Room, warp) -> Muscle:
    centre = None if muscle.centre is None else warp.transform(muscle.centre[None])[0]
    return reshaped(muscle, fibres, room, centre)
