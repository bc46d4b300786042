# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel 5: expressions as starting points."""

import bpy

from ..headshop_addon import active, dependencies
from .common import SidebarPanel, hint, progress


class HEADSHOP_PT_expressions(SidebarPanel, bpy.types.Panel):
    """Set the sliders to an expression."""

    bl_label = "Expressions"

    def draw(self, context):
        """A button for each."""
        layout = self.layout
        progress(layout, "expressions")
        if active.skin(context) is None:
            hint(layout, context, "Expressions need a head: build one first.")
            return
        if not dependencies.available("scipy"):
            return
        from ..sim.acting.expressions import expressions

        layout.operator("headshop.reset_muscles", text="Neutral", icon="LOOP_BACK")
        grid = layout.grid_flow(row_major=True, columns=2, even_columns=True, align=True)
        for name in expressions():
            grid.operator("headshop.set_expression", text=name.replace("_", " ").title()).expression = name


def classes():
    """In order of registration."""
    return (HEADSHOP_PT_expressions,)
