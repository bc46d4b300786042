# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake the rig of sliders."""

import bpy

from ..headshop_addon.bake_job import BakeJob


class HEADSHOP_OT_bake_rig(BakeJob, bpy.types.Operator):
    """Shape keys as sliders of all muscles and controls, with drivers that play the simulation, without this extension too"""

    bl_idname = "headshop.bake_rig"
    bl_label = "Bake Rig"
    bl_options = {"REGISTER", "UNDO"}
    poses = "rig"
