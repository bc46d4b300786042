# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel 3: from scan and landmarks to a head."""

import bpy

from ..headshop_addon import active, dependencies, detail_images, heads, heat_map, scan_landmarks
from .common import SidebarPanel, hint, progress

#: Key in the fit report -> what to call it.
_FIT = (("mean_mm", "Mean distance"), ("p95_mm", "95 % within"), ("landmark_mean_mm", "Landmarks"))


class HEADSHOP_PT_build(SidebarPanel, bpy.types.Panel):
    """Build the head."""

    bl_label = "Build"

    def draw(self, context):
        """One big button, then what came out of it."""
        layout = self.layout
        if progress(layout, "build"):
            return
        layout.prop(context.scene.headshop, "relax")
        column = layout.column(align=True)
        column.label(text="Leave Out")
        column.grid_flow(columns=2, row_major=True, align=True).prop(context.scene.headshop, "no_skin")
        row = layout.row()
        row.scale_y = 1.4
        row.operator("headshop.build_head", icon="USER")
        scan, skin = active.scan(context), active.skin(context)
        if scan is None and skin is None:
            hint(layout, context, "A head is built from a scan with landmarks.")
        elif scan is not None and len(scan_landmarks.to_build(scan)) < scan_landmarks.ENOUGH_TO_BUILD:
            hint(layout, context, "Find the landmarks of the scan first, or click at least four.")
        elif skin is None and context.mode == "OBJECT":
            hint(layout, context, "Ready to build.", "CHECKMARK")
        if skin is not None:
            _result(layout, context, skin)


def _result(layout, context, skin):
    fit = heads.read_report(skin).get("fit", {})
    box = layout.box().column(align=True)
    box.label(text=heads.head_name(skin), icon="OUTLINER_OB_MESH")
    for key, text in _FIT:
        if key in fit:
            row = box.row()
            row.label(text=text)
            side = row.row()
            side.alignment = "RIGHT"
            side.label(text=f"{fit[key]:.2f} mm")
    if fit.get("relaxed"):
        row = box.row()
        row.label(text="Relaxed, jaw closed by")
        side = row.row()
        side.alignment = "RIGHT"
        side.label(text=f"{fit['relaxed']['jaw_degrees']:.1f}\N{DEGREE SIGN}")
    if "sentence" in fit:
        hint(layout, context, fit["sentence"], "CHECKMARK")
    if fit.get("advice"):
        hint(layout, context, fit["advice"])
    _show(layout, context, skin)
    _fit(layout, context, skin)
    if detail_images.images_of(skin) is not None:
        layout.prop(skin.headshop, "detail")
    column = layout.column(align=True)
    column.operator("headshop.dress_head", icon="MATERIAL")
    column.operator("headshop.repack_uv", icon="UV")
    if not dependencies.available("xatlas"):
        hint(layout, context, "Repacking UVs needs the library xatlas, which this Blender does not have.")


def _show(layout, context, skin):
    """What of the head is seen in the viewport."""
    row = layout.row(align=True)
    row.prop(skin, "hide_viewport", text="Skin", toggle=True, invert_checkbox=True)
    muscles = active.muscles_collection(skin)
    if muscles is not None:
        row.prop(muscles, "hide_viewport", text="Muscles", toggle=True, invert_checkbox=True)
        row.prop(muscles, "hide_render", text="", toggle=True, invert_checkbox=True)
    scan = heads.scan_of(skin)
    # A deleted one stays in the file while the head knows it.
    if scan is not None and scan.name in context.scene.objects:
        row.prop(scan, "hide_viewport", text="Scan", toggle=True, invert_checkbox=True)


def _fit(layout, context, skin):
    """The heat map's switch, scale and legend."""
    if not heat_map.has_fit(skin):
        return
    settings = skin.headshop
    column = layout.column(align=True)
    row = column.row(align=True)
    row.prop(settings, "show_fit", toggle=True, icon="COLOR")
    if settings.show_fit:
        row.prop(settings, "fit_range", text="mm")
        end = f"{settings.fit_range:.2f} mm"
        hint(
            layout, context, f"Blue: {end} inside the scan. White: on it. Red: {end} outside. Grey: invented.", "BLANK1"
        )


def classes():
    """In order of registration."""
    return (HEADSHOP_PT_build,)
