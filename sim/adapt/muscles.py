# SPDX-License-Identifier: GPL-3.0-or-later
"""Muscles under a fitted skin: warped with the space between skin and bone, then kept in it (Kähler 2002, 5.2, item 3)."""

import numpy as np

from ..anatomy.head import Muscle
from ..anatomy.muscle_bounds import eased
from ..anatomy.muscle_room import Room
from ..anatomy.muscle_shape import all_reshaped
from .rest import BONES, Rest

CLEAR = 0.15  # mm a fibre keeps from the walls of its room, at least


def carried_muscles(rest: Rest, parts, eyes, warp) -> tuple[Muscle, ...]:
    """The reference's muscles sent through ``warp`` (`Rest.between`) and kept between skin and bone.

    parts : name -> (n, 3) mm of skin and bones as they are now; eyes : the two `Eye`
    """
    muscles, skin = rest.head.muscles, rest.head.skin.moved(parts["skin"])
    bones = [rest.head.parts[name].moved(parts[name]) for name in BONES]
    room = Room(skin, bones, rest.inner, [(eye.centre, eye.radius) for eye in eyes], mirrored=False)
    cuts = np.cumsum([m.fibres.size // 3 for m in muscles])[:-1]
    points = warp.transform(np.concatenate([m.fibres.reshape(-1, 3) for m in muscles]))
    fibres = [f.reshape(m.fibres.shape) for f, m in zip(np.split(points, cuts), muscles, strict=True)]
    fibres = eased(
        fibres,
        [np.ones(f.shape[:2]) for f in fibres],
        [np.full(f.shape[:2], CLEAR) for f in fibres],
        [m.ring for m in muscles],
        room,
        rounds=5,
        beside=0.25,
    )
    centres = [None if m.centre is None else warp.transform(m.centre[None])[0] for m in muscles]
    return tuple(all_reshaped(muscles, fibres, room, centres))
