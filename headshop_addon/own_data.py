# SPDX-License-Identifier: GPL-3.0-or-later
"""What a head may write to, so that it acts for itself: meshes that no other head wears and no other file owns, and notes that
are saved with library overrides too."""

import bpy

from . import heads


def own_meshes(skin: bpy.types.Object) -> None:
    """Give a head meshes of its own where they are not, before anything is written to them.

    Where another head wears the same ones, as a duplicate with linked data does or a second library override of one head, what
    moves one of them would move the other. And a mesh that is linked cannot keep a shape key: this file does not save it, and
    undo leaves the mesh with a key that is gone, at which Blender crashes.
    """
    parts = list(heads.parts_of(skin).values())
    others = set()
    if any(obj.data.users > 1 and obj.data.library is None for obj in parts):
        others = {o.data for o in bpy.data.objects if o.type == "MESH" and heads.PART in o and o not in parts}
    foreign = [obj for obj in parts if obj.library is None and (obj.data.library is not None or obj.data in others)]
    before = skin.data.shape_keys
    for obj in foreign:
        obj.data = obj.data.copy()
    if skin not in foreign or before is None:
        return
    for obj in foreign:  # keys that follow the skin's are to follow the new skin's
        keys = obj.data.shape_keys
        for curve in keys.animation_data.drivers if keys and keys.animation_data else ():
            for target in (target for variable in curve.driver.variables for target in variable.targets):
                if target.id == before:
                    target.id = skin.data.shape_keys


def note(obj: bpy.types.Object, key: str, default=None):
    """What `keep_note` kept with a part, or the default."""
    kept = obj.data.get(key, obj.get(key))
    return default if kept is None or isinstance(kept, str) and not kept else kept


def keep_note(obj: bpy.types.Object, key: str, value) -> None:
    """Keep with a part what was made of it: on its object, of a library override on its mesh, for Blender saves nothing that is
    new on an overridden object."""
    (obj.data if obj.override_library or key in obj.data else obj)[key] = value


def drop_note(obj: bpy.types.Object, key: str) -> None:
    """Forget what `keep_note` kept; what an override has from its library is hidden."""
    if obj.override_library:
        obj.data[key] = ""
        return
    for block in (obj, obj.data):
        if key in block:
            del block[key]
