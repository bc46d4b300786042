# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel 1: the scan."""

import json

import bpy

from ..headshop_addon import active, heads
from .common import SidebarPanel, hint, needs, progress

#: What cleaning counts that an artist may want to know.
_FAULTS = ("nonfinite_vertices", "nonfinite_faces", "stray_vertices", "zero_area_faces", "duplicate_faces")


class HEADSHOP_PT_scan(SidebarPanel, bpy.types.Panel):
    """Bring a scan in."""

    bl_label = "Scan"

    def draw(self, context):
        """Import, sample, chosen scan and what is known about it."""
        layout, settings = self.layout, context.scene.headshop
        if progress(layout, "scan"):
            return
        if needs(layout, context, "scipy"):
            return
        column = layout.column(align=True)
        column.operator("headshop.import_scan", icon="IMPORT")
        row = column.row(align=True)
        row.operator("headshop.make_sample", icon="USER")
        row.operator("headshop.choose_scan", text="Use Selected", icon="RESTRICT_SELECT_OFF")
        scan = active.scan(context)
        if scan is not None or active.scans(context):
            layout.prop(settings, "scan", text="")
        else:
            hint(layout, context, "Start here: import the scan of a head, or add the sample to try things out.")
        if scan is None:
            return
        _facts(layout, context, scan)


def _facts(layout, context, scan):
    from ..sim.scan.units import BY_FACE, UNITS

    facts = json.loads(scan.get(heads.REPORT, "{}")).get("scan", {})
    column = layout.column(align=True)
    column.scale_y = 0.85
    size = max(scan.dimensions) * 1000
    column.label(text=f"{len(scan.data.polygons):,} faces, {size:.0f} mm", icon="MESH_DATA")
    if facts.get("points"):
        column.label(text=f"Made of {facts['points']:,} points", icon="OUTLINER_OB_POINTCLOUD")
    if facts.get("sheets"):
        told = f"{facts['sheets']} overlapping sheets, laid onto each other: {facts['sheets_apart_mm']:.1f} mm apart"
        column.label(text=told, icon="MOD_BOOLEAN")
    if "unit" in facts:
        unit, axes = facts["unit"], f"{facts['up']} up, facing {facts['front']}"
        usual = unit in UNITS
        column.label(text=f"Read as {unit}, {axes}" if usual else f"Read as {axes}", icon="ORIENTATION_GLOBAL")
        if not usual:
            told = ", by the face" if unit == BY_FACE else ""
            column.label(text=f"1 unit = {facts['unit_scale']:.3g} mm{told}", icon="FIXED_SIZE")
    removed = sum(facts.get(kind, 0) for kind in _FAULTS)
    if removed:
        column.label(text=f"{removed:,} faulty elements removed", icon="BRUSH_DATA")
    if not facts.get("certain", True):
        hint(layout, context, "Unsure about unit and axes: look, and import again with your own choice.", "ERROR")


def classes():
    """In order of registration."""
    return (HEADSHOP_PT_scan,)
