# SPDX-License-Identifier: GPL-3.0-or-later
"""Pack the skin's UVs."""

import bpy

from ..headshop_addon import active, polls
from ..headshop_addon.jobs import Simple


class HEADSHOP_OT_repack_uv(Simple, bpy.types.Operator):
    """Pack the skin's UV islands into one square, in a UV layer of its own"""

    bl_idname = "headshop.repack_uv"
    bl_label = "Repack UVs"
    bl_options = {"REGISTER", "UNDO"}

    resolution: bpy.props.IntProperty(
        name="Resolution",
        description="Pixels along the square the islands are spaced for",
        default=2048,
        min=256,
        max=16384,
    )

    @classmethod
    def poll(cls, context):
        """Needs a head and xatlas."""
        return polls.library(cls, "xatlas") and polls.own_head(cls, context) and polls.object_mode(cls, context)

    def act(self, context):
        """Pack."""
        from ..headshop_addon.atlas import LAYER, repack

        share = repack(active.skin(context), self.resolution)
        return f"UV layer {LAYER}: the islands fill {share:.0%} of the square"
