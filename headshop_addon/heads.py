# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads in a .blend: one collection of ordinary objects that carries all a head needs to be simulated again.

The skin object holds the anatomy (landmarks, muscles, jaw, eyes) as a JSON document in the ID property
``headshop_anatomy``; every part says what it is in ``headshop_part``. All parts are children of the skin, and the skin
points at each of them, so that appending or linking the skin or the collection alone brings the whole head.
"""

import json

import bpy
import numpy as np

from ..sim.anatomy.head import MATERIALS, PARTS, SKIN_GROUPS, Head
from ..sim.anatomy.storage import anatomy_document, head_from_document
from ..sim.errors import InputError
from . import bridge

ANATOMY = "headshop_anatomy"
PART = "headshop_part"
MUSCLE = "headshop_muscle"
COUNT = "headshop_vertices"
SCAN = "headshop_scan"
REPORT = "headshop_report"
COLLECTION = "head"  # the part that is a head's collection
_POINTERS = "headshop_objects"

TITLES = {"eye_l": "Eye Left", "eye_r": "Eye Right", "teeth_upper": "Upper Teeth", "teeth_lower": "Lower Teeth"}


def create_head(
    head: Head,
    name: str,
    scan_object: bpy.types.Object | None = None,
    scene: bpy.types.Scene | None = None,
    attributes: dict[str, np.ndarray] | None = None,
) -> bpy.types.Collection:
    """Put ``head`` into the scene as a collection; returns it.

    Parameters
    ----------
    scan_object : the scan it was made from; linked into the collection and left out of renders
    attributes : per-vertex values (n,) kept on the skin, such as ``fitted`` and ``distance_mm`` (float)
    """
    scene = scene or bpy.context.scene
    collection = bpy.data.collections.new(name)
    collection[PART] = COLLECTION
    name = collection.name  # Blender may have numbered it
    scene.collection.children.link(collection)
    skin = _add_part(collection, head, "skin", name)
    bridge.write_groups(skin, head.groups)
    for key, values in (attributes or {}).items():
        bridge.write_attribute(skin.data, key, values)
    skin[ANATOMY] = json.dumps(anatomy_document(head), separators=(",", ":"))
    subdivision = skin.modifiers.new("Subdivision", "SUBSURF")
    subdivision.subdivision_type, subdivision.levels, subdivision.render_levels = "CATMULL_CLARK", 1, 2
    subdivision.uv_smooth = "NONE"  # images are painted for UVs that run straight across each face
    others = [_add_part(collection, head, part, name) for part in PARTS if part in head.parts and part != "skin"]
    others += _add_muscles(collection, head, name)
    for obj in others:
        obj.parent = skin
    if scan_object is not None:
        _keep_scan(collection, scan_object)
        skin[SCAN] = scan_object
    skin[_POINTERS] = {obj.get(MUSCLE, obj[PART]): obj for obj in others}
    return collection


def _add_part(collection, head: Head, part: str, name: str) -> bpy.types.Object:
    obj = bridge.mesh_to_object(head.parts[part], f"{name} {TITLES.get(part, part.title())}")
    obj[PART], obj[COUNT] = part, len(head.parts[part].vertices)
    for _ in MATERIALS.get(part, ()):
        obj.data.materials.append(None)  # a slot each; what fills it is a matter of looks
    collection.objects.link(obj)
    return obj


def _add_muscles(collection, head: Head, name: str) -> list[bpy.types.Object]:
    child = bpy.data.collections.new(f"{name} Muscles")
    collection.children.link(child)
    child.hide_render = True  # they stay where they are when the face moves, and would come through it
    objects = []
    for muscle in head.muscles:
        obj = bridge.mesh_to_object(muscle.shape, f"{name} {muscle.name}")
        obj[PART], obj[MUSCLE] = "muscle", muscle.name
        obj.data.materials.append(None)
        child.objects.link(obj)
        objects.append(obj)
    return objects


def _keep_scan(collection, scan_object) -> None:
    scan_object.hide_render = True
    scan_object[PART] = "scan"
    if scan_object.name not in collection.objects:
        collection.objects.link(scan_object)


def is_skin(obj) -> bool:
    """Whether an object is the skin of a head."""
    return obj is not None and obj.type == "MESH" and obj.get(PART) == "skin" and ANATOMY in obj


def find_heads(scene: bpy.types.Scene | None = None) -> list[bpy.types.Object]:
    """The skin objects of all heads in the scene, by name."""
    return sorted(filter(is_skin, (scene or bpy.context.scene).objects), key=lambda obj: obj.name)


def only_head(scene: bpy.types.Scene | None = None, name: str | None = None) -> bpy.types.Object:
    """The skin of the scene's head; ``name`` chooses among several.

    Raises
    ------
    InputError : there is none, several, or none of that name.
    """
    found = find_heads(scene)
    names = [head_name(skin) for skin in found]
    if name is not None:
        found = [skin for skin, known in zip(found, names, strict=True) if known == name]
        if not found:
            raise InputError(f"There is no head {name!r} in the file (there is {', '.join(names) or 'none'}).")
    if not found:
        raise InputError("There is no head in the file: build one from a scan first.")
    if len(found) > 1:
        raise InputError(f"The file holds several heads ({', '.join(names)}): choose one with --head.")
    return found[0]


def skin_of(obj) -> bpy.types.Object | None:
    """The skin object of the head that an object belongs to, or None."""
    while obj is not None and not is_skin(obj):
        obj = obj.parent
    return obj


def head_collection(skin: bpy.types.Object) -> bpy.types.Collection | None:
    """The collection that was made for a head, or None if none of its objects is in it any more."""
    holders = (c for obj in (skin, *_objects_of(skin)) for c in obj.users_collection)
    return next((c for c in holders if c.get(PART) == COLLECTION or c.name == head_name(skin)), None)


def stands_with(skin: bpy.types.Object) -> list[bpy.types.Object]:
    """What is seen where a head stands: its objects, what hangs on them and what lies in its collection; scans are not."""
    collection = head_collection(skin)
    beside = collection.all_objects if collection is not None else ()
    return [
        o for o in dict.fromkeys((skin, *skin.children_recursive, *_objects_of(skin), *beside)) if o.get(PART) != "scan"
    ]


def hide(skin: bpy.types.Object, scene: bpy.types.Scene) -> None:
    """Hide a head as the eyes of the outliner do, where an artist finds it: its collection, and by themselves those of its
    objects that are kept elsewhere."""
    collection = head_collection(skin)
    own = {collection, *collection.children_recursive} if collection is not None else set()
    elsewhere = [obj for obj in stands_with(skin) if not own.issuperset(obj.users_collection)]
    for layer in scene.view_layers:
        for shown in _below(layer.layer_collection):
            shown.hide_viewport = shown.hide_viewport or shown.collection == collection
        for obj in elsewhere:
            if obj.name in layer.objects:
                obj.hide_set(True, view_layer=layer)
    for each in (collection, *elsewhere):
        if each is not None:
            each.hide_render = True


def _below(shown: bpy.types.LayerCollection):
    for child in shown.children:
        yield child
        yield from _below(child)


def head_name(skin: bpy.types.Object) -> str:
    """``Fran`` for the skin object ``Fran Skin``."""
    return skin.name.partition(" Skin")[0]


def parts_of(skin: bpy.types.Object) -> dict[str, bpy.types.Object]:
    """Part name (`PARTS`) -> object, the skin included, in the order of `PARTS`."""
    found = {child.get(PART): child for child in _objects_of(skin) if child.type == "MESH"}
    found["skin"] = skin
    return {part: found[part] for part in PARTS if part in found}


def muscles_of(skin: bpy.types.Object) -> dict[str, bpy.types.Object]:
    """Muscle name -> the object that shows it."""
    return {child[MUSCLE]: child for child in _objects_of(skin) if MUSCLE in child}


def scan_of(skin: bpy.types.Object) -> bpy.types.Object | None:
    """The scan a head was made from, if it is still there."""
    scan = skin.get(SCAN)
    return scan if isinstance(scan, bpy.types.Object) else None


def built_from(scene: bpy.types.Scene, scan: bpy.types.Object) -> list[bpy.types.Object]:
    """The skins of the heads in ``scene`` that were made from ``scan``."""
    return [skin for skin in find_heads(scene) if scan_of(skin) == scan]


def _objects_of(skin):
    children = list(skin.children)
    pointers = skin.get(_POINTERS)
    pointed = [obj for obj in pointers.values() if obj is not None] if pointers else []
    return children or [obj for obj in pointed if not _is_of_another(obj, skin)]


def _is_of_another(obj, skin) -> bool:
    """Whether a part that a skin points at belongs to another head: a skin that was duplicated alone still points at the
    parts of the head it came from, which must stay as they are. The head that a library override overrides is no other."""
    overridden = skin.override_library.reference if skin.override_library else None
    return is_skin(obj.parent) and obj.parent not in (skin, overridden)


def read_head(skin: bpy.types.Object) -> Head:
    """The head in mm, in the skin's local space, from its rest shapes: all the simulation needs.

    Raises
    ------
    InputError : not a head, a part is gone, a mesh was given other vertices, or another version wrote it.
    """
    if not is_skin(skin):
        raise InputError(f"{getattr(skin, 'name', 'Nothing')} is not the skin of a head: choose a head that was built.")
    objects = parts_of(skin)
    if why := lacking(skin):
        raise InputError(why)
    parts = {part: _read_part(skin, obj) for part, obj in objects.items()}
    groups = {name: weights for name, weights in bridge.read_groups(skin).items() if name in SKIN_GROUPS}
    try:
        document = json.loads(skin[ANATOMY])
    except (ValueError, TypeError):
        raise InputError(f"The anatomy stored on {skin.name!r} cannot be read: build the head again.") from None
    return head_from_document(parts, groups, document)


def lacking(skin: bpy.types.Object) -> str:
    """What is wrong with a head that has lost parts, never had them or was given other vertices, and what to do; empty for a
    whole one."""
    objects = parts_of(skin)
    if absent := ", ".join(part for part in PARTS if part not in objects):
        return (
            f"The head {skin.name!r} has no {absent}: undo their deletion, append the head again, or duplicate it with all "
            "its children (Select, Select Grouped, Children)."
        )
    return next(filter(None, map(_other_vertices, objects.values())), "")


def _other_vertices(obj) -> str:
    count = len(obj.data.vertices)
    expected = obj.get(COUNT, count)
    if count == expected:
        return ""
    return (
        f"{obj.name!r} has {count} vertices instead of {expected}: its mesh may be reshaped but not be given other vertices; "
        "undo that or build the head again."
    )


def _read_part(skin, obj):
    mesh = bridge.object_to_mesh(obj)
    matrix = placement(skin, obj)
    if np.array_equal(matrix, np.eye(4)):
        return mesh
    return mesh.moved(mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3] / bridge.METRES)


def placement(skin: bpy.types.Object, obj: bpy.types.Object) -> np.ndarray:
    """(4, 4) from a part's local space to the skin's, in metres; the identity unless an artist moved the part."""
    if obj == skin:
        return np.eye(4)
    # not matrix_world: the dependency graph may not have run yet
    return np.array(obj.matrix_parent_inverse @ obj.matrix_basis, dtype=float)


def write_report(skin: bpy.types.Object, report: dict) -> None:
    """Keep the build's report with the head."""
    skin[REPORT] = json.dumps(report)


def read_report(skin: bpy.types.Object) -> dict:
    """The report kept with the head; empty if there is none."""
    try:
        return json.loads(skin.get(REPORT, "{}"))
    except (ValueError, TypeError):
        return {}
