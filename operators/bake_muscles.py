# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake all muscles to shape keys."""

import bpy

from ..headshop_addon.bake_job import BakeJob


class HEADSHOP_OT_bake_muscles(BakeJob, bpy.types.Operator):
    """Simulate every muscle alone and keep each as a shape key"""

    bl_idname = "headshop.bake_muscles"
    bl_label = "Bake Muscles"
    bl_options = {"REGISTER", "UNDO"}
    poses = "muscles"
