# SPDX-License-Identifier: GPL-3.0-or-later
"""Forget all landmarks of the scan."""

import bpy

from ..headshop_addon import active, polls, scan_landmarks
from ..headshop_addon.jobs import Simple


class HEADSHOP_OT_clear_landmarks(Simple, bpy.types.Operator):
    """Forget all landmarks of the scan"""

    bl_idname = "headshop.clear_landmarks"
    bl_label = "Clear Landmarks"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        """Needs landmarks."""
        if not polls.scan(cls, context):
            return False
        if not scan_landmarks.positions(active.scan(context), "PLACED", "FOUND", "DERIVED"):
            cls.poll_message_set("There are no landmarks yet")
            return False
        return True

    def act(self, context):
        """Forget them."""
        scan_landmarks.forget(active.scan(context))
