# SPDX-License-Identifier: GPL-3.0-or-later
"""How a file made on the command line looks when it is opened: the head fills the viewport."""

import bpy
import numpy as np
from mathutils import Euler, Vector

from . import bridge

_TURN = Euler(np.radians([86.0, 0.0, 24.0]))  # from the front, a little to the subject's left
_NEAR = 0.005  # m; Blender's own clips the nose of a head seen from close by


def look_at(skin: bpy.types.Object) -> None:
    """Point every 3D viewport of the file at the head."""
    points = bridge.read_positions(skin) * bridge.METRES
    low, high = points.min(axis=0), points.max(axis=0)
    centre = skin.matrix_world @ Vector((low + high) / 2)
    for screen in bpy.data.screens:
        for area in screen.areas:
            if area.type == "VIEW_3D":
                space = area.spaces.active
                space.clip_start = _NEAR
                space.region_3d.view_location = centre
                space.region_3d.view_distance = 1.8 * float((high - low).max())
                space.region_3d.view_rotation = _TURN.to_quaternion()
                space.overlay.show_extras = False  # the studio's lights would stand in front of the face
