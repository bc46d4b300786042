# SPDX-License-Identifier: GPL-3.0-or-later
"""Forget all landmarks of the scan."""

import bpy

from ..headshop_addon import active, polls, scan_landmarks
from ..headshop_addon.jobs import Simple
from ..sim.anatomy.landmark_names import label
from ..sim.errors import InputError


class HEADSHOP_OT_clear_landmarks(Simple, bpy.types.Operator):
    """Forget all landmarks of the scan"""

    bl_idname = "headshop.clear_landmarks"
    bl_label = "Clear Landmarks"
    bl_options = {"REGISTER", "UNDO"}

    name: bpy.props.StringProperty(
        name="Landmark", description="Leave out this one only", options={"SKIP_SAVE", "HIDDEN"}
    )

    @classmethod
    def description(cls, context, properties):
        """Another tooltip where one landmark is left out."""
        if properties.name:
            return f"Build without this landmark: {label(properties.name)}. The others tell where it is"
        return cls.__doc__

    @classmethod
    def poll(cls, context):
        """Needs landmarks."""
        if not polls.own_scan(cls, context):
            return False
        if not scan_landmarks.positions(active.scan(context), "PLACED", "FOUND", "DERIVED"):
            cls.poll_message_set("There are no landmarks yet")
            return False
        return True

    def act(self, context):
        """Forget them, or leave out one."""
        if not self.name:
            scan_landmarks.forget(active.scan(context))
            return None
        if self.name not in scan_landmarks.entries(active.scan(context)):
            raise InputError(f"There is no landmark {self.name!r}.")
        scan_landmarks.leave_out(active.scan(context), self.name)
        return f"{self.name} is left out"
