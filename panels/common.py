# SPDX-License-Identifier: GPL-3.0-or-later
"""What all panels share: their place, hints in plain words, and the progress of a job."""

import textwrap

from ..headshop_addon import dependencies, jobs


class SidebarPanel:
    """Mixin: a panel of the tab *Head Shop*."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Head Shop"


def hint(layout, context, text: str, icon: str = "INFO") -> None:
    """A sentence broken into lines that fit the sidebar."""
    scale = context.preferences.system.ui_scale
    room = max(int((context.region.width - 70 * scale) / (6.4 * scale)), 16)
    column = layout.column(align=True)
    column.scale_y = 0.8
    for number, line in enumerate(textwrap.wrap(text, room)):
        column.label(text=line, icon=icon if number == 0 else "BLANK1")


def progress(layout, panel: str) -> bool:
    """The progress bar of the job in progress, in the panel it belongs to; others are greyed out meanwhile."""
    layout.enabled = jobs.running is None or jobs.running.panel == panel
    if jobs.running is None or jobs.running.panel != panel:
        return False
    column = layout.column(align=True)
    column.progress(factor=jobs.running.fraction, type="BAR", text=f"{jobs.running.title}: {jobs.running.fraction:.0%}")
    column.label(text=jobs.running.label)
    column.label(text="Esc cancels")
    return True


def needs(layout, context, library: str) -> bool:
    """True, with a hint, where a library is missing."""
    reason = dependencies.reason(library)
    if reason:
        hint(layout, context, reason + ".", "ERROR")
    return bool(reason)
