# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake all expressions to shape keys."""

import bpy

from ..headshop_addon.bake_job import BakeJob


class HEADSHOP_OT_bake_expressions(BakeJob, bpy.types.Operator):
    """Simulate every expression and keep each as a shape key"""

    bl_idname = "headshop.bake_expressions"
    bl_label = "Bake Expressions"
    bl_options = {"REGISTER", "UNDO"}
    poses = "expressions"
