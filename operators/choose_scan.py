# SPDX-License-Identifier: GPL-3.0-or-later
"""Take what is already in the scene as the scan."""

import bpy

from ..headshop_addon import active, polls
from ..headshop_addon.jobs import Job


class HEADSHOP_OT_choose_scan(Job, bpy.types.Operator):
    """Take a cleaned, upright copy of the selected meshes or point clouds as the scan, in the same place"""

    bl_idname = "headshop.choose_scan"
    bl_label = "Use Selected Objects"
    bl_options = {"REGISTER", "UNDO"}
    panel = "scan"

    @classmethod
    def poll(cls, context):
        """Needs a mesh or point cloud object that is no part of a head."""
        if not active.choosable(context):
            cls.poll_message_set("Select mesh or point cloud objects that are neither a scan nor part of a head")
            return False
        return polls.library(cls, "scipy") and polls.object_mode(cls, context)

    def work(self, context):
        """Copy, clean, turn upright."""
        from ..headshop_addon import scan_objects

        return (yield from scan_objects.adopt(context, active.choosable(context)))

    def finish(self, context, result):
        """Say what came in."""
        from ..headshop_addon import scan_objects

        return scan_objects.summary(result)
