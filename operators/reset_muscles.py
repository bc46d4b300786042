# SPDX-License-Identifier: GPL-3.0-or-later
"""Relax the face."""

import bpy

from ..headshop_addon import active, live, polls
from ..headshop_addon.jobs import Simple


class HEADSHOP_OT_reset_muscles(Simple, bpy.types.Operator):
    """Set all muscles, jaw, lids and gaze to rest"""

    bl_idname = "headshop.reset_muscles"
    bl_label = "Relax All"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        """Needs a head."""
        return polls.own_head(cls, context)

    def act(self, context):
        """Zero every slider."""
        live.set_sliders(active.skin(context), {})
