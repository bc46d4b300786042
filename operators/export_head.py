# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the head for a game engine."""

import bpy
from bpy_extras.io_utils import ExportHelper

from ..headshop_addon import active, polls
from ..headshop_addon.jobs import Simple


class HEADSHOP_OT_export_head(Simple, ExportHelper, bpy.types.Operator):
    """Write the head with its baked shapes as glTF, FBX or USD"""

    bl_idname = "headshop.export_head"
    bl_label = "Export Head"
    bl_options = {"REGISTER"}

    filter_glob: bpy.props.StringProperty(default="*.glb;*.fbx;*.usdc;*.usdz", options={"HIDDEN"})
    kind: bpy.props.EnumProperty(
        name="Format",
        items=(
            (".glb", "glTF", "One binary file"),
            (".fbx", "FBX", "One binary file, for engines that read no glTF"),
            (".usdc", "USD", "A binary file, with its pictures in a folder beside it"),
            (".usdz", "USD, packed", "One file that holds its pictures"),
        ),
    )

    @property
    def filename_ext(self):
        """The extension that belongs to the format."""
        return self.kind

    @classmethod
    def poll(cls, context):
        """Needs a head."""
        return polls.library(cls, "scipy") and polls.head(cls, context) and polls.object_mode(cls, context)

    def act(self, context):
        """Export."""
        from ..headshop_addon.baking import is_baked
        from ..headshop_addon.export import export_head
        from ..headshop_addon.performance import is_keyed

        skin = active.skin(context)
        names = export_head(skin, self.filepath)
        if is_keyed(skin) and not is_baked(skin):
            why = "sliders are not written: bake Keyed Sliders to Animation first"
            self.report({"WARNING"}, f"{self.filepath}: a head that does not move, for {why}")
            return None
        return f"{self.filepath}: {len(names)} shape{'s' * (len(names) != 1)}"
