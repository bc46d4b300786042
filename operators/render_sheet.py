# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the contact sheet."""

import bpy
from bpy_extras.io_utils import ExportHelper

from ..headshop_addon import active, polls
from ..headshop_addon.jobs import Job


class HEADSHOP_OT_render_sheet(Job, ExportHelper, bpy.types.Operator):
    """Render scan, head, skull, muscles and baked expressions side by side into a picture file"""

    bl_idname = "headshop.render_sheet"
    bl_label = "Render Sheet"
    bl_options = {"REGISTER"}
    panel = "bake"

    filename_ext = ".png"
    filter_glob: bpy.props.StringProperty(default="*.png", options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        """Needs a head."""
        return polls.library(cls, "scipy") and polls.head(cls, context) and polls.object_mode(cls, context)

    def invoke(self, context, event):
        """Ask for the file."""
        self._asked = True
        return ExportHelper.invoke(self, context, event)

    def execute(self, context):
        """Render: under a timer where the file was asked for, at once for scripts."""
        if getattr(self, "_asked", False):
            return Job.invoke(self, context, None)
        return Job.execute(self, context)

    def work(self, context):
        """Render."""
        from ..headshop_addon.contact_sheet import render_sheet

        return (yield from render_sheet(active.skin(context), self.filepath))

    def finish(self, context, result):
        """Say where it is."""
        return f"Sheet written to {self.filepath}"
