# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials, lights and camera."""

import bpy

from ..headshop_addon import active, polls
from ..headshop_addon.jobs import Simple


class HEADSHOP_OT_dress_head(Simple, bpy.types.Operator):
    """Give the head its materials and set up three lights and a camera"""

    bl_idname = "headshop.dress_head"
    bl_label = "Materials and Lights"
    bl_options = {"REGISTER", "UNDO"}

    lights: bpy.props.BoolProperty(name="Lights and Camera", description="Set up the stage too", default=True)

    @classmethod
    def poll(cls, context):
        """Needs a head."""
        return polls.own_head(cls, context) and polls.object_mode(cls, context)

    def act(self, context):
        """Dress, then light."""
        from ..headshop_addon.materials import dress_head
        from ..headshop_addon.stage import set_stage

        skin = active.skin(context)
        dress_head(skin)
        if self.lights:
            set_stage(context.scene, skin)
