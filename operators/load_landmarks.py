# SPDX-License-Identifier: GPL-3.0-or-later
"""Read landmarks from a file."""

import bpy
from bpy_extras.io_utils import ImportHelper

from ..headshop_addon import active, polls
from ..headshop_addon.jobs import Simple


class HEADSHOP_OT_load_landmarks(Simple, ImportHelper, bpy.types.Operator):
    """Read the scan's landmarks from a file, in the scan file's own axes; they replace those that are there"""

    bl_idname = "headshop.load_landmarks"
    bl_label = "Load Landmarks"
    bl_options = {"REGISTER", "UNDO"}

    filename_ext = ".json"
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        """Needs a scan and the warp."""
        return polls.library(cls, "scipy") and polls.own_scan(cls, context)

    def act(self, context):
        """Read, turn into the scan's place, store."""
        from ..headshop_addon.scan_objects import load_landmarks

        count = load_landmarks(active.scan(context), self.filepath)
        return f"{count} landmarks read"
