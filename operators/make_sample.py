# SPDX-License-Identifier: GPL-3.0-or-later
"""Add the embedded sample subject."""

import bpy

from ..headshop_addon import polls
from ..headshop_addon.jobs import Job


class HEADSHOP_OT_make_sample(Job, bpy.types.Operator):
    """Add the sample: an individual made from the reference head, scanned by a virtual scanner, with landmarks"""

    bl_idname = "headshop.make_sample"
    bl_label = "Make Sample"
    bl_options = {"REGISTER", "UNDO"}
    panel = "scan"

    seed: bpy.props.IntProperty(name="Seed", description="Another number is another person", default=1, min=0)
    with_landmarks: bpy.props.BoolProperty(
        name="With Landmarks", description="Place the landmarks the sample comes with", default=True
    )

    @classmethod
    def poll(cls, context):
        """Needs the scanner."""
        return polls.library(cls, "scipy") and polls.object_mode(cls, context)

    def work(self, context):
        """Vary and scan."""
        from ..sim.scan.sample import make_sample

        return (yield from make_sample(seed=self.seed))

    def finish(self, context, result):
        """Add scan and landmarks."""
        from ..headshop_addon import scan_objects

        scan = scan_objects.add_sample(context, result, self.with_landmarks)
        return scan_objects.summary(scan)
