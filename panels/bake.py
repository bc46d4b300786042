# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel 6: bake to shape keys, take the head elsewhere."""

import bpy

from ..headshop_addon import active, dependencies
from .common import SidebarPanel, hint, progress


class HEADSHOP_PT_bake(SidebarPanel, bpy.types.Panel):
    """Bake, render, export."""

    bl_label = "Bake"

    def draw(self, context):
        """Shape keys, animation, pictures and files."""
        layout = self.layout
        if progress(layout, "bake"):
            return
        skin = active.skin(context)
        if skin is None:
            hint(layout, context, "There is nothing to bake yet: build a head first.")
            return
        column = layout.column(align=True)
        column.operator("headshop.bake_expressions", text="Expressions to Shape Keys", icon="SHAPEKEY_DATA")
        column.operator("headshop.bake_muscles", text="Muscles to Shape Keys", icon="SHAPEKEY_DATA")
        column.operator("headshop.bake_rig", text="Rig of Sliders to Shape Keys", icon="DRIVER")
        column = layout.column(align=True)
        settings = skin.headshop
        bake = column.operator("headshop.bake_performance", text="Keyed Sliders to Animation", icon="ACTION")
        bake.dynamics = settings.dynamics
        column.prop(settings, "dynamics")
        if settings.dynamics:
            column = layout.column(align=True)
            column.prop(settings, "wind")
            column.prop(settings, "turbulence", slider=True)
            column.prop(settings, "wind_seed")
        if dependencies.available("scipy"):
            from ..headshop_addon.shape_keys import baked_names

            count = len(baked_names(skin))
            row = layout.row(align=True)
            if count:
                row.label(text=f"{count} shapes baked", icon="CHECKMARK")
            row.operator("headshop.remove_baked", icon="X")
        column = layout.column(align=True)
        column.operator("headshop.render_sheet", icon="RENDER_STILL")
        column.operator("headshop.export_head", icon="EXPORT")


def classes():
    """In order of registration."""
    return (HEADSHOP_PT_bake,)
