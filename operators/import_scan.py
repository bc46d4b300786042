# SPDX-License-Identifier: GPL-3.0-or-later
"""Read a scan file."""

import bpy
from bpy_extras.io_utils import ImportHelper

from ..headshop_addon import polls
from ..headshop_addon.jobs import FileJob

UNITS = (
    ("AUTO", "Detect", "Judge by the size of the head"),
    ("mm", "Millimetres", "Numbers in the file are millimetres"),
    ("cm", "Centimetres", "Numbers in the file are centimetres"),
    ("m", "Metres", "Numbers in the file are metres"),
    ("in", "Inches", "Numbers in the file are inches"),
    ("OTHER", "Other", "Numbers in the file are in a unit of its own"),
)
UP = (
    ("AUTO", "Detect", "Judge by the shape of the head"),
    *(
        (axis, axis, f"The crown of the head points along {axis} in the file")
        for axis in ("+Z", "+Y", "+X", "-X", "-Y", "-Z")
    ),
)


class HEADSHOP_OT_import_scan(FileJob, ImportHelper, bpy.types.Operator):
    """Read a head scan (PLY, OBJ, STL, glTF, USD, FBX, a range map or points), clean it and set it upright in real size"""

    bl_idname = "headshop.import_scan"
    bl_label = "Import Scan"
    bl_options = {"REGISTER", "UNDO"}
    panel = "scan"

    filename_ext = ""
    filter_glob: bpy.props.StringProperty(
        default="*.ply;*.obj;*.stl;*.glb;*.gltf;*.usd;*.usda;*.usdc;*.usdz;*.fbx;*.ech;*.echo;*.cyb;*.cyber;*.npz;*.json;"
        "*.pcd;*.xyz;*.xyzrgb;*.xyzn;*.pts;*.asc;*.csv;*.txt",
        options={"HIDDEN"},
    )
    unit: bpy.props.EnumProperty(name="Unit", description="Unit of length in the file", items=UNITS)
    unit_mm: bpy.props.FloatProperty(
        name="Millimetres per Unit", description="With Other: how long one unit is", default=1.0, min=1e-6, precision=4
    )
    up: bpy.props.EnumProperty(name="Up", description="Direction of the crown of the head in the file", items=UP)

    def draw(self, context):
        """What is read how; the length of a unit only where it counts."""
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "unit")
        if self.unit == "OTHER":
            layout.prop(self, "unit_mm")
        layout.prop(self, "up")

    @classmethod
    def poll(cls, context):
        """Needs the cleaning code."""
        return polls.library(cls, "scipy") and polls.object_mode(cls, context)

    def work(self, context):
        """Read, clean, turn upright, add."""
        from ..headshop_addon import scan_objects

        unit, up = (None if value == "AUTO" else value for value in (self.unit, self.up))
        unit = self.unit_mm if unit == "OTHER" else unit
        return (yield from scan_objects.import_scan(context, self.filepath, unit, up))

    def finish(self, context, result):
        """Say what came in."""
        from ..headshop_addon import scan_objects

        return scan_objects.summary(result)
