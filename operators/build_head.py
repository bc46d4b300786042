# SPDX-License-Identifier: GPL-3.0-or-later
"""Build a head from the scan and its landmarks."""

import bpy

from ..headshop_addon import active, heads, polls, scan_landmarks
from ..headshop_addon.jobs import Job


class HEADSHOP_OT_build_head(Job, bpy.types.Operator):
    """Fit skin, skull, muscles, eyes, teeth and tongue to the scan"""

    bl_idname = "headshop.build_head"
    bl_label = "Build Head"
    bl_options = {"REGISTER", "UNDO"}
    panel = "build"

    name: bpy.props.StringProperty(
        # Hidden: typing a name after a build would build again, with the window frozen.
        name="Name",
        description="Name of the head; empty: the scan's",
        options={"SKIP_SAVE", "HIDDEN"},
    )

    @classmethod
    def poll(cls, context):
        """Needs a scan with enough landmarks."""
        if not (polls.library(cls, "scipy") and polls.scan(cls, context) and polls.object_mode(cls, context)):
            return False
        missing = scan_landmarks.ENOUGH_TO_BUILD - len(scan_landmarks.to_build(active.scan(context)))
        if missing > 0:
            cls.poll_message_set(f"Find the landmarks of the scan first, or click {missing} more")
            return False
        return True

    def work(self, context):
        """Fit and add the head."""
        from ..headshop_addon import scan_objects

        return (yield from scan_objects.build(context, active.scan(context), self.name))

    def finish(self, context, result):
        """Make the head the one the sidebar works on."""
        skin, report = result
        fit = report["fit"]
        said = f"{skin.name}: mean distance to the scan {fit['mean_mm']:.2f} mm"
        if fit.get("doubted_mm"):
            said += f"; check {', '.join(fit['doubted_mm'])}, far from where the scan seems to have it"
        others = [heads.head_name(s) for s in heads.built_from(context.scene, active.scan(context)) if s != skin]
        return said + "".join(f"; {other}, built before from this scan, is hidden" for other in others[-1:])
