# SPDX-License-Identifier: GPL-3.0-or-later
"""Take a mesh that is already in the scene as the scan."""

import bpy

from ..headshop_addon import heads, polls
from ..headshop_addon.jobs import Job


class HEADSHOP_OT_choose_scan(Job, bpy.types.Operator):
    """Take a cleaned, upright copy of the active mesh or point cloud as the scan, in the same place"""

    bl_idname = "headshop.choose_scan"
    bl_label = "Use Active Object"
    bl_options = {"REGISTER", "UNDO"}
    panel = "scan"

    @classmethod
    def poll(cls, context):
        """Needs a mesh or point cloud object that is no part of a head."""
        obj = context.active_object
        if obj is None or obj.type not in ("MESH", "POINTCLOUD") or heads.PART in obj:
            cls.poll_message_set("Select a mesh or point cloud object that is neither a scan nor part of a head")
            return False
        return polls.library(cls, "scipy") and polls.object_mode(cls, context)

    def work(self, context):
        """Copy, clean, turn upright."""
        from ..headshop_addon import scan_objects

        return (yield from scan_objects.adopt(context, context.active_object))

    def finish(self, context, result):
        """Say what came in."""
        from ..headshop_addon import scan_objects

        return scan_objects.summary(result)
