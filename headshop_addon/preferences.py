# SPDX-License-Identifier: GPL-3.0-or-later
"""Preferences of the extension: how landmarks are drawn, and which libraries were found."""

import bpy

from . import dependencies


class HEADSHOP_AP_preferences(bpy.types.AddonPreferences):
    """Head Shop's preferences."""

    bl_idname = __package__.rpartition(".")[0]

    point_size: bpy.props.FloatProperty(
        name="Landmark Size", description="Size of landmark points in the viewport", default=9.0, min=3.0, max=30.0
    )
    text_size: bpy.props.IntProperty(
        name="Text Size", description="Size of landmark names in the viewport", default=11, min=6, max=40
    )

    def draw(self, context):
        """Settings, then the libraries."""
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "point_size")
        layout.prop(self, "text_size")
        for name, use in dependencies.NEEDED_FOR.items():
            row = layout.row()
            if dependencies.available(name):
                row.label(text=f"{name} {dependencies.version(name)}: {use}", icon="CHECKMARK")
            else:
                row.label(text=f"{name} is missing: no {use}", icon="ERROR")


def preferences(context=None) -> "HEADSHOP_AP_preferences | None":
    """The preferences, or None where the extension runs without having been enabled by Blender."""
    addon = (context or bpy.context).preferences.addons.get(HEADSHOP_AP_preferences.bl_idname)
    return addon.preferences if addon else None


register, unregister = bpy.utils.register_classes_factory((HEADSHOP_AP_preferences,))
