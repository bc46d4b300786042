# SPDX-License-Identifier: GPL-3.0-or-later
"""Keyframe all sliders."""

import bpy

from ..headshop_addon import active, live, polls
from ..headshop_addon.jobs import Simple


class HEADSHOP_OT_key_sliders(Simple, bpy.types.Operator):
    """Insert keyframes for all muscles, jaw, lids and gaze at the current frame"""

    bl_idname = "headshop.key_sliders"
    bl_label = "Key All Sliders"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        """Needs a head that may be animated."""
        return polls.own_head(cls, context)

    def act(self, context):
        """Insert the keys."""
        live.key_sliders(active.skin(context), context.scene.frame_current)
        return f"Sliders keyed at frame {context.scene.frame_current}"
