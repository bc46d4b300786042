# SPDX-License-Identifier: GPL-3.0-or-later
"""Take what is already in the scene as the scan."""

import bpy

from ..headshop_addon import active, polls
from ..headshop_addon.jobs import Job


class HEADSHOP_OT_choose_scan(Job, bpy.types.Operator):
    """Take a clean, upright copy of the selected meshes or points as the scan; or choose another scan, with its landmarks"""

    bl_idname = "headshop.choose_scan"
    bl_label = "Use Selected Objects"
    bl_options = {"REGISTER", "UNDO"}
    panel = "scan"

    @classmethod
    def poll(cls, context):
        """Needs a mesh or point cloud object that is no part of a head, or a scan other than the chosen one."""
        if not active.choosable(context) and active.other_scan(context) is None:
            cls.poll_message_set("Select mesh or point cloud objects that are not part of a head, or another scan")
            return False
        return polls.library(cls, "scipy") and polls.object_mode(cls, context)

    def work(self, context):
        """Copy, clean, turn upright; a scan is all that already."""
        from ..headshop_addon import scan_objects

        scan = active.other_scan(context)
        if scan is not None:
            context.scene.headshop.scan = scan
            return scan
        return (yield from scan_objects.adopt(context, active.choosable(context)))

    def finish(self, context, result):
        """Say what came in."""
        from ..headshop_addon import scan_objects

        return scan_objects.summary(result)
