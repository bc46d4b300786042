# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake all expressions to shape keys."""

import bpy

from ..headshop_addon import active, polls
from ..headshop_addon.jobs import Job


class HEADSHOP_OT_bake_expressions(Job, bpy.types.Operator):
    """Simulate every expression and keep each as a shape key"""

    bl_idname = "headshop.bake_expressions"
    bl_label = "Bake Expressions"
    bl_options = {"REGISTER", "UNDO"}
    panel = "bake"

    @classmethod
    def poll(cls, context):
        """Needs a head and the simulation."""
        return polls.library(cls, "scipy") and polls.head(cls, context) and polls.object_mode(cls, context)

    def work(self, context):
        """Simulate and write."""
        from ..headshop_addon.baking import bake

        return (yield from bake(active.skin(context), "expressions"))

    def finish(self, context, result):
        """Say what came out."""
        from ..headshop_addon.baking import summary

        return summary(result)
