# SPDX-License-Identifier: GPL-3.0-or-later
"""Let a head that was linked from another file act in this one."""

import bpy

from ..headshop_addon import active, heads
from ..headshop_addon.jobs import Simple


class HEADSHOP_OT_override_head(Simple, bpy.types.Operator):
    """Make a library override of a linked head whose sliders can be moved and keyed in this file"""

    bl_idname = "headshop.override_head"
    bl_label = "Override Head"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        """Needs a linked head, or a linked collection's instance with one."""
        if active.linked(context) is None:
            cls.poll_message_set("Link a head's collection from another file first")
            return False
        return context.mode == "OBJECT"

    def act(self, context):
        """Override what is linked yet, and let the skin be edited, which Blender's own command does not."""
        linked = active.linked(context)
        before = set(heads.find_heads(context.scene))
        if not heads.is_skin(linked):
            with context.temp_override(active_object=linked, object=linked, selected_objects=[linked]):
                bpy.ops.object.make_override_library()
        elif linked.library is not None:
            _override_collection(context, heads.head_collection(linked) or _first_collection(linked))
        else:
            before.discard(linked)
        found = [skin for skin in heads.find_heads(context.scene) if skin not in before and skin.override_library]
        for skin in found:
            skin.override_library.is_system_override = False
        if found:
            context.scene.headshop.head = context.view_layer.objects.active = found[0]
            found[0].select_set(True)
            return f"{heads.head_name(found[0])} can be moved and keyed in this file"


def _first_collection(linked):
    """Where a head lies whose own collection was dissolved."""
    return next((c for c in linked.users_collection if c.name in bpy.data.collections), None)


def _override_collection(context, collection) -> None:
    """Override a linked collection in the scene, in whose place the override comes."""
    collection.override_hierarchy_create(context.scene, context.view_layer, do_fully_editable=True)
    for parent in (context.scene.collection, *context.scene.collection.children_recursive):
        if parent.library is None and parent.override_library is None and collection in parent.children.values():
            parent.children.unlink(collection)
    context.view_layer.update()
