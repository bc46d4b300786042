# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel 2: landmarks on the scan."""

import bpy

from ..headshop_addon import active, polls, scan_landmarks
from ..sim.anatomy.landmark_names import LABELS, SKIN, label
from .common import SidebarPanel, hint, progress

_ICONS = {"PLACED": "KEYFRAME_HLT", "FOUND": "HANDLETYPE_AUTO_CLAMP_VEC", "DERIVED": "KEYFRAME", "MISSING": "BLANK1"}


class HEADSHOP_UL_landmarks(bpy.types.UIList):
    """Landmarks with their state."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index):
        """State, short name, long name; grey where it hangs in mid-air."""
        split = layout.split(factor=0.3)
        split.active = not (item.state == "FOUND" and item.mid_air)
        split.label(text=item.name, icon=_ICONS[item.state])
        split.label(text=LABELS[item.name.partition("_")[0]].partition(",")[0].capitalize())


class HEADSHOP_PT_landmarks(SidebarPanel, bpy.types.Panel):
    """Place landmarks."""

    bl_label = "Landmarks"

    def draw(self, context):
        """Click, load, save; then the list."""
        layout, settings = self.layout, context.scene.headshop
        if progress(layout, "landmarks"):
            return
        scan = active.scan(context)
        if scan is None:
            hint(layout, context, "Landmarks are placed on a scan: import one first.")
            return
        placed = len(scan_landmarks.positions(scan))
        column = layout.column(align=True)
        row = column.row(align=True)
        row.scale_y = 1.4
        row.operator("headshop.find_landmarks", icon="VIEWZOOM")
        row = column.row(align=True)
        row.operator("headshop.click_landmarks", icon="RESTRICT_SELECT_OFF")
        row = column.row(align=True)
        row.operator("headshop.load_landmarks", text="Load", icon="FILE_FOLDER")
        row.operator("headshop.save_landmarks", text="Save", icon="FILE_TICK")
        row.operator("headshop.clear_landmarks", text="Clear", icon="TRASH")
        found = len(scan_landmarks.positions(scan, "FOUND"))
        if active.is_foreign(scan):
            hint(layout, context, polls.SCAN_LINKED + ".", "ERROR")
        elif found:
            hint(layout, context, _counted(scan), "CHECKMARK")
            _advise(layout, context, scan)
        elif placed == 0:
            hint(layout, context, "Find the landmarks, or click the points you are asked for; four are enough.")
        elif placed < scan_landmarks.ENOUGH_TO_BUILD:
            wanted = scan_landmarks.ENOUGH_TO_BUILD - placed
            hint(layout, context, f"{placed} placed, {wanted} more needed to build a head.")
        else:
            hint(layout, context, _counted(scan), "CHECKMARK")
        row = layout.row(align=True)
        row.prop(settings, "show_landmarks", text="Show", toggle=True)
        row.prop(settings, "show_names", toggle=True)


def _advise(layout, context, scan):
    """Name the landmark whose correction helps most."""
    name = next(iter(scan_landmarks.most_useful(scan)), None)
    if name is not None:
        layout.operator("headshop.click_landmarks", text=f"Correct {name}", icon="RESTRICT_SELECT_OFF").start = name
        hint(layout, context, f"It helps most: {label(name)}.", "BLANK1")


def _counted(scan) -> str:
    """How many landmarks there are of each state; found ones in mid-air count by themselves."""
    counts = {
        "found": len(scan_landmarks.positions(scan, "FOUND")) - len(scan_landmarks.in_mid_air(scan)),
        "in mid-air": len(scan_landmarks.in_mid_air(scan)),
        "placed": len(scan_landmarks.positions(scan)),
        "estimated": len(scan_landmarks.positions(scan, "DERIVED")),
    }
    return ", ".join(f"{count} {state}" for state, count in counts.items() if count)


class HEADSHOP_PT_landmark_list(SidebarPanel, bpy.types.Panel):
    """All landmarks, to place one of them anew."""

    bl_label = "All Landmarks"
    bl_parent_id = "HEADSHOP_PT_landmarks"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        """Needs a scan whose landmarks were begun."""
        scan = active.scan(context)
        return scan is not None and len(scan.headshop.landmarks) == len(SKIN)

    def draw(self, context):
        """The list and what to do with its chosen one."""
        layout = self.layout
        group = active.scan(context).headshop
        layout.template_list("HEADSHOP_UL_landmarks", "", group, "landmarks", group, "landmark_index", rows=6)
        if 0 <= group.landmark_index < len(group.landmarks):
            name = group.landmarks[group.landmark_index].name
            hint(layout, context, label(name).capitalize() + ".")
            row = layout.row(align=True)
            row.operator("headshop.click_landmarks", text=f"Place {name}", icon="RESTRICT_SELECT_OFF").start = name
            if group.landmarks[group.landmark_index].state in ("PLACED", "FOUND"):
                row.operator("headshop.clear_landmarks", text="Leave Out", icon="X").name = name


def classes():
    """In order of registration."""
    return (HEADSHOP_UL_landmarks, HEADSHOP_PT_landmarks, HEADSHOP_PT_landmark_list)
