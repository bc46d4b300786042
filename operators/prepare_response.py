# SPDX-License-Identifier: GPL-3.0-or-later
"""Learn the head's response for an instant preview."""

import bpy

from ..headshop_addon import active, following, live, polls
from ..headshop_addon.jobs import Job


class HEADSHOP_OT_prepare_response(Job, bpy.types.Operator):
    """Simulate many poses once and learn from them, so that sliders and playback show the simulation at once"""

    bl_idname = "headshop.prepare_response"
    bl_label = "Prepare Instant Preview"
    bl_options = {"REGISTER", "UNDO"}
    panel = "muscles"
    care: bpy.props.EnumProperty(
        name="Quality",
        description="How many poses to simulate",
        items=(
            ("quick", "Quick", "A rough preview in about a minute"),
            ("normal", "Normal", "Some minutes"),
            ("fine", "Fine", "The nearest to the simulation; takes several times as long"),
        ),
        default="normal",
    )

    @classmethod
    def poll(cls, context):
        """Needs a head and the simulation."""
        return polls.library(cls, "scipy") and polls.own_head(cls, context) and polls.object_mode(cls, context)

    def work(self, context):
        """Simulate, learn and keep it with the head."""
        from ..headshop_addon import response

        return (yield from response.prepare(active.skin(context), self.care))

    def finish(self, context, result):
        """Let the sliders use it."""
        skin = active.skin(context)
        following.forget(skin)
        skin.headshop.model = "INSTANT"
        live.follow(skin)
        _, accuracy = result
        off = {kind: row["rms_mm"] for kind, row in accuracy.items()}
        said = f"within {off['expressions']:.2f} mm (root mean square) of the simulation in expressions"
        return f"The preview is ready: {said}, {max(off.values()):.2f} mm in random extremes"
