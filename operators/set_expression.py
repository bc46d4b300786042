# SPDX-License-Identifier: GPL-3.0-or-later
"""Set the sliders to an expression."""

import bpy

from ..headshop_addon import active, live, polls
from ..headshop_addon.jobs import Simple
from ..sim.errors import InputError


class HEADSHOP_OT_set_expression(Simple, bpy.types.Operator):
    """Set the muscle sliders to this expression; key or change them from there"""

    bl_idname = "headshop.set_expression"
    bl_label = "Set Expression"
    bl_options = {"REGISTER", "UNDO"}

    expression: bpy.props.StringProperty(name="Expression", description="Name of the expression")
    amount: bpy.props.FloatProperty(
        name="Amount", description="How strong the expression is", default=1.0, min=0.0, max=1.0, subtype="FACTOR"
    )

    @classmethod
    def poll(cls, context):
        """Needs a head and the simulation."""
        return polls.own_head(cls, context) and polls.library(cls, "scipy")

    def act(self, context):
        """Look the expression up and set the sliders."""
        from ..sim.acting.expressions import expressions

        known = expressions()
        if self.expression not in known:
            raise InputError(f"There is no expression {self.expression!r}: choose one of {', '.join(known)}.")
        values = known[self.expression].values()
        live.set_sliders(active.skin(context), {name: value * self.amount for name, value in values.items()})
