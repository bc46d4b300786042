# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake keyed sliders to shape-key animation."""

import bpy

from ..headshop_addon import active, polls
from ..headshop_addon.jobs import Job


class HEADSHOP_OT_bake_performance(Job, bpy.types.Operator):
    """Simulate the keyed sliders over the scene's frames and keep the motion as animated shape keys"""

    bl_idname = "headshop.bake_performance"
    bl_label = "Bake Animation"
    bl_options = {"REGISTER", "UNDO"}
    panel = "bake"

    dynamics: bpy.props.BoolProperty(
        name="Dynamics",
        description="Flesh swings: it feels gravity, the motion of the head's object and wind",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context):
        """Needs a head with keyed or driven sliders."""
        if not (polls.library(cls, "scipy") and polls.own_head(cls, context) and polls.object_mode(cls, context)):
            return False
        from ..headshop_addon.performance import is_keyed

        if not is_keyed(active.skin(context)):
            cls.poll_message_set("Key the sliders at two or more frames first")
            return False
        return True

    def work(self, context):
        """Simulate frame by frame and write."""
        from ..headshop_addon.performance import bake_performance, keyed_poses, require_few

        scene, skin = context.scene, active.skin(context)
        frames = range(scene.frame_start, scene.frame_end + 1)
        require_few(len(frames))
        poses = keyed_poses(skin, frames, scene)
        moving = {}
        if self.dynamics:
            from ..headshop_addon.head_place import felt_in, frame_rate

            moving = {"around": felt_in(skin, scene, frames), "fps": frame_rate(scene)}
        return (yield from bake_performance(skin, poses, scene.frame_start, **moving))

    def finish(self, context, result):
        """Say what came out."""
        keys = result["keys"].get("skin", 0)
        return f"{result['frames']} frames in {keys} shape keys; the face now follows them instead of the sliders"
