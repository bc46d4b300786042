# SPDX-License-Identifier: GPL-3.0-or-later
"""Write landmarks to a file."""

import bpy
from bpy_extras.io_utils import ExportHelper

from ..headshop_addon import active, polls, scan_landmarks
from ..headshop_addon.jobs import Simple


class HEADSHOP_OT_save_landmarks(Simple, ExportHelper, bpy.types.Operator):
    """Write the placed landmarks, and the found ones that are sure enough, to a file, in the scan file's own axes"""

    bl_idname = "headshop.save_landmarks"
    bl_label = "Save Landmarks"
    bl_options = {"REGISTER"}

    filename_ext = ".json"
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        """Needs landmarks."""
        if not polls.library(cls, "scipy") or not polls.scan(cls, context):
            return False
        if not scan_landmarks.to_build(active.scan(context)):
            cls.poll_message_set("Find or click landmarks first")
            return False
        return True

    def act(self, context):
        """Turn back into the file's axes and write."""
        from ..headshop_addon.scan_objects import save_landmarks

        count = save_landmarks(active.scan(context), self.filepath)
        return f"{count} landmarks written to {self.filepath}"
