# SPDX-License-Identifier: GPL-3.0-or-later
"""Find the landmarks of the scan without help."""

import bpy

from ..headshop_addon import active, bridge, polls, scan_landmarks
from ..headshop_addon.jobs import Job


class HEADSHOP_OT_find_landmarks(Job, bpy.types.Operator):
    """Find the landmarks of the scan by its shape. Those placed by hand stay; correct the others by clicking"""

    bl_idname = "headshop.find_landmarks"
    bl_label = "Find Landmarks"
    bl_options = {"REGISTER", "UNDO"}
    panel = "landmarks"

    @classmethod
    def poll(cls, context):
        """Needs a scan that is not being edited."""
        return polls.library(cls, "scipy") and polls.own_scan(cls, context) and polls.object_mode(cls, context)

    def work(self, context):
        """Look for the face in the scan's mesh."""
        from ..headshop_addon import scan_objects
        from ..sim.landmarks.find import find_landmarks

        self._scan = active.scan(context)
        any_size = not scan_objects.unit_is_told(self._scan)
        usual = scan_objects.usual_scales(self._scan)
        return (yield from find_landmarks(bridge.scan_mesh(self._scan), any_size=any_size, usual=usual))

    def finish(self, context, result):
        """Store them on the scan, which is brought to a person's size if it is in no unit, and set upright."""
        from ..headshop_addon import scan_objects

        said = result.summary()
        if result.unit_scale != 1.0:
            why = scan_objects.resize(self._scan, result.unit_scale)
            scan_objects.look_at(context)
            said += f"; {why}, so the scan is {result.unit_scale:.3g} times as large now"
        placed = scan_objects.stand_upright(self._scan, result)
        if placed is not result:
            scan_objects.look_at(context)
            said += "; the scan was turned upright by them"
        scan_landmarks.take_found(self._scan, placed)
        context.scene.headshop.show_landmarks = True
        return ". ".join(filter(None, (f"{self._scan.name}: {said}", result.doubt)))
