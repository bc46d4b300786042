# SPDX-License-Identifier: GPL-3.0-or-later
"""Which scan and which head the sidebar and the operators work on, and what is seen of it."""

import bpy

from . import heads


def scan(context) -> bpy.types.Object | None:
    """The scan chosen in the sidebar, if it is in this scene."""
    chosen = context.scene.headshop.scan
    return chosen if chosen is not None and chosen.name in context.scene.objects else None


def other_scan(context) -> bpy.types.Object | None:
    """The active object, if it is a scan that is not the chosen one."""
    there = context.active_object
    is_scan = there is not None and there.type == "MESH" and there.get(heads.PART) == "scan"
    return there if is_scan and there.select_get() and there != scan(context) else None


def is_foreign(scan) -> bool:
    """Whether a scan was linked, overridden or not: of its landmarks Blender saves nothing with this file."""
    return scan.library is not None or scan.override_library is not None


def scans(context) -> list[bpy.types.Object]:
    """All scans in the scene."""
    return [obj for obj in context.scene.objects if obj.get(heads.PART) == "scan"]


def skin(context) -> bpy.types.Object | None:
    """The skin of the head in question: the active object's, the one chosen in the sidebar, or the only one."""
    found = heads.skin_of(getattr(context, "active_object", None))
    if found is not None:
        return found
    chosen = context.scene.headshop.head
    if heads.is_skin(chosen) and chosen.name in context.scene.objects:
        return chosen
    return next(iter(heads.find_heads(context.scene)), None)


def linked(context) -> bpy.types.Object | None:
    """What has to be overridden before a linked head can act here: an instance of its collection, or its skin, linked or
    overridden without being editable, as Blender's own command leaves it."""
    instance = getattr(context, "active_object", None)
    collection = instance.instance_collection if instance is not None and instance.type == "EMPTY" else None
    if collection is not None and collection.library is not None and any(map(heads.is_skin, collection.all_objects)):
        return instance
    there = skin(context)
    if there is None:
        return None
    override = there.override_library
    return there if there.library is not None or (override is not None and override.is_system_override) else None


def muscles_collection(skin: bpy.types.Object) -> bpy.types.Collection | None:
    """The collection that holds a head's muscles, to show or hide them; None where the artist dissolved it."""
    collection = heads.head_collection(skin)
    muscles = set(heads.muscles_of(skin).values())
    children = collection.children if collection else ()
    return next((child for child in children if muscles & set(child.objects)), None)


def choosable(context) -> list[bpy.types.Object]:
    """The objects that an artist means by a scan: of the selected ones those that may be, the active one first; if there are
    none, the active one."""
    first = context.active_object
    kept = [obj for obj in context.selected_objects if _may_be_scan(obj)]
    if not kept and first is not None and _may_be_scan(first):
        return [first]
    return sorted(kept, key=lambda obj: obj != first)


def _may_be_scan(obj) -> bool:
    return obj.type in ("MESH", "POINTCLOUD") and heads.PART not in obj
