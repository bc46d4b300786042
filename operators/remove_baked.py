# SPDX-License-Identifier: GPL-3.0-or-later
"""Take what was baked off a head."""

import bpy

from ..headshop_addon import active, polls
from ..headshop_addon.jobs import Simple


class HEADSHOP_OT_remove_baked(Simple, bpy.types.Operator):
    """Take baked shapes, rig and animation off the head; shape keys of your own stay, and the sliders move the face again"""

    bl_idname = "headshop.remove_baked"
    bl_label = "Remove Baked"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        """Needs a head with something baked on it."""
        if not (polls.library(cls, "scipy") and polls.own_head(cls, context) and polls.object_mode(cls, context)):
            return False
        from ..headshop_addon.baking import is_baked

        if not is_baked(active.skin(context)):
            cls.poll_message_set("Nothing is baked on this head")
            return False
        return True

    def act(self, context):
        """Remove, and let the sliders act."""
        from ..headshop_addon.baking import remove_baked

        remove_baked(active.skin(context))
