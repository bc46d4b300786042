# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake the rig of sliders."""

import bpy

from ..headshop_addon.bake_job import BakeJob


class HEADSHOP_OT_bake_rig(BakeJob, bpy.types.Operator):
    """A shape key for every muscle and control whose value is its slider, and drivers that make them play the
    simulation together, also without this extension"""

    bl_idname = "headshop.bake_rig"
    bl_label = "Bake Rig"
    bl_options = {"REGISTER", "UNDO"}
    poses = "rig"
