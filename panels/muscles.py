# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel 4: muscles, jaw, lids and gaze as sliders."""

import bpy

from ..headshop_addon import active, heads, jobs, muscle_names, response
from .common import SidebarPanel, hint, progress


class HEADSHOP_PT_muscles(SidebarPanel, bpy.types.Panel):
    """Contract muscles and see the face follow."""

    bl_label = "Muscles"

    def draw(self, context):
        """Which head, whether it follows, and what to do with all sliders."""
        layout = self.layout
        if progress(layout, "muscles"):
            return
        skin = active.skin(context)
        if active.linked(context) is not None:
            hint(layout, context, "A linked head acts in this file once it is overridden.", "LINKED")
            layout.operator("headshop.override_head", icon="LIBRARY_DATA_OVERRIDE")
        elif skin is None:
            hint(layout, context, "Muscles belong to a head: build one first.")
        if skin is None:
            return
        if len(heads.find_heads(context.scene)) > 1:
            layout.label(text=heads.head_name(skin), icon="OUTLINER_OB_MESH")
        if why := heads.lacking(skin):
            hint(layout, context, why, "ERROR")
        layout.prop(skin.headshop, "live", text="Face Follows Sliders", toggle=True, icon="PLAY")
        row = layout.row(align=True)
        row.active = skin.headshop.live
        row.prop(skin.headshop, "model", expand=True)
        if skin.headshop.model == "INSTANT":
            if not response.is_prepared(skin):
                hint(layout, context, "Simulated until it was prepared once.")
            text = "Prepare Again" if response.is_prepared(skin) else "Prepare Instant Preview"
            layout.operator("headshop.prepare_response", text=text, icon="FILE_REFRESH")
        row = layout.row(align=True)
        row.operator("headshop.key_sliders", text="Key All", icon="KEY_HLT")
        row.operator("headshop.reset_muscles", icon="LOOP_BACK")


class _Sliders(SidebarPanel):
    """A sub-panel of sliders; exists once there is a head."""

    bl_parent_id = "HEADSHOP_PT_muscles"

    @classmethod
    def poll(cls, context):
        """Needs a head."""
        return active.skin(context) is not None


class HEADSHOP_PT_controls(_Sliders, bpy.types.Panel):
    """Jaw, lids, gaze, lips and cheeks."""

    bl_label = "Jaw, Eyes, Lips and Cheeks"

    def draw(self, context):
        """The jaw above, then left and right beside each other as on the screen."""
        self.layout.enabled = jobs.running is None
        group = active.skin(context).headshop.controls
        column = self.layout.column(align=True)
        for name in ("jaw_open", "jaw_forward", "jaw_side"):
            column.prop(group, name, text=f"Jaw {muscle_names.CONTROLS[name][0]}")
        row = self.layout.row(align=True)
        row.prop(group, "blink_r", text="Blink R", slider=True)
        row.prop(group, "blink_l", text="Blink L", slider=True)
        row = self.layout.row(align=True)
        row.prop(group, "gaze_x", text="Look Side")
        row.prop(group, "gaze_z", text="Look Up")
        for side, label in (("r", "R"), ("l", "L")):
            row = self.layout.row(align=True)
            row.prop(group, f"gaze_{side}_x", text=f"Eye {label} Side")
            row.prop(group, f"gaze_{side}_z", text=f"Eye {label} Up")
        column = self.layout.column(align=True)
        for name in ("lip_upper_forward", "lip_lower_forward", "lips_together", "cheek_puff", "tongue_out"):
            column.prop(group, name)


def _draw_region(self, context):
    """Each muscle's name, and under it its sides: the subject's right on the left, as one sees the face."""
    self.layout.enabled = jobs.running is None
    group = active.skin(context).headshop.muscles
    for names in muscle_names.by_region()[self.bl_label]:
        column = self.layout.column(align=True)
        if len(names) == 1:
            column.prop(group, names[0], slider=True)
            continue
        column.label(text=muscle_names.label(muscle_names.base(names[0])))
        row = column.row(align=True)
        for name in names:
            row.prop(group, name, text=name[-1].upper(), slider=True)


def _region_panel(number: int, region: str) -> type:
    body = {"bl_label": region, "bl_options": {"DEFAULT_CLOSED"}, "draw": _draw_region, "__module__": __name__}
    return type(
        f"HEADSHOP_PT_muscles_{number}", (_Sliders, bpy.types.Panel), {**body, "__doc__": f"Muscles: {region}."}
    )


def classes():
    """In order of registration; a sub-panel for every region that has muscles."""
    regions = [_region_panel(number, region) for number, region in enumerate(muscle_names.by_region())]
    return (HEADSHOP_PT_muscles, HEADSHOP_PT_controls, *regions)
