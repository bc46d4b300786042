# SPDX-License-Identifier: GPL-3.0-or-later
"""An engine-ready copy of a head: plain meshes with shape keys of exact names, no modifiers, no drivers.

The copies live in a scene of their own for the moment of the export; the artist's scene stays as it was.
"""

import re
from contextlib import contextmanager
from pathlib import Path

import bpy

from ..sim.errors import InputError
from . import heads, shape_keys
from .engine_files import KINDS, textures_folder
from .export_formats import write_scene
from .outputs import Outputs
from .plain_materials import plain_materials
from .quiet import quiet
from .whole_files import require_whole

#: What an engine gets: all that is seen. Bones and muscles stay behind.
PARTS = ("skin", "eye_l", "eye_r", "teeth_upper", "teeth_lower", "tongue")
#: The shape key that follows the sliders; the engine has no sliders.
_LIVE = "Live"


def export_head(skin: bpy.types.Object, path) -> list[str]:
    """Write the head's visible parts with all their shape keys; returns the names of the skin's.

    The file appears whole or not at all, with the folder of its pictures if it is of a kind that needs one
    (`engine_files.textures_folder`). A baked performance goes along as animation of the shape keys.

    Raises
    ------
    InputError : not a whole head, an unknown extension, the file cannot be written there, or an add-on of Blender's that
        it takes is switched off.
    """
    path = Path(path)
    if path.suffix.lower() not in KINDS:
        raise InputError(f"{path.name} must end in {', '.join(KINDS)}: rename it.")
    heads.read_head(skin)
    with Outputs() as outputs, _copies(skin) as (scene, copies):
        temporary = outputs.file(path, textures_folder(path))
        keys = copies["skin"].data.shape_keys
        animated = any(c.data.shape_keys and _action_of(c.data.shape_keys) for c in copies.values())
        with plain_materials(skin, scene, copies), quiet() as printed:
            try:
                write_scene(temporary.resolve(), copies.values(), animated)
            except (RuntimeError, OSError) as error:
                _refuse_full_disk(path, error, printed())
                raise RuntimeError(f"{error} {printed()}") from error
        if not temporary.is_file():
            raise RuntimeError(f"Blender wrote no {path.suffix} file")
        require_whole(temporary)
        return [block.name for block in keys.key_blocks[1:]] if keys else []


def _refuse_full_disk(path: Path, error: Exception, printed: str) -> None:
    """Raise `InputError` if an exporter failed because it could not write; most say so in a traceback of theirs."""
    causes = re.findall(r"(?:OSError|occurred writing file): (?:\[Errno \d+\] )?([^:\n]+)", f"{error}\n{printed}")
    if isinstance(error, OSError):
        causes.append(error.strerror or str(error))
    if causes:
        raise InputError(f"{path.name} cannot be written ({causes[-1].strip()}): is the disk full?") from error


def _action_of(keys):
    return keys.animation_data.action if keys.animation_data is not None else None


@contextmanager
def _copies(skin: bpy.types.Object):
    """A scene that is the context's, and part -> a copy of its object, alone in it; they bear the originals' names."""
    original = bpy.context.scene
    scene = bpy.data.scenes.new("Head Shop export")
    scene.render.fps, scene.render.fps_base = original.render.fps, original.render.fps_base
    scene.frame_start, scene.frame_end = original.frame_start, original.frame_end
    scene.unit_settings.scale_length = original.unit_settings.scale_length
    copies, lent = {}, []
    try:
        for part, obj in heads.parts_of(skin).items():
            if part in PARTS:
                copies[part] = _copy(obj, lent)
                scene.collection.objects.link(copies[part])
        for part, obj in copies.items():
            obj.parent = None
            obj.matrix_world = skin.matrix_world @ _matrix(heads.placement(skin, heads.parts_of(skin)[part]))
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0], collection=scene.collection):
            scene.view_layers[0].update()
            yield scene, copies
    finally:
        for obj in copies.values():
            bpy.data.meshes.remove(obj.data)  # takes the object along
        bpy.data.scenes.remove(scene)
        for block, name in reversed(lent):
            block.name = name


def _matrix(rows):
    from mathutils import Matrix

    return Matrix(rows.tolist())


def _copy(obj, lent: list) -> bpy.types.Object:
    """A copy without modifiers, drivers, custom properties or the live pose, under the original's own name."""
    mesh = obj.data.copy()
    for block in (obj, obj.data):
        lent.append((block, block.name))
    name, mesh_name = obj.name, obj.data.name
    obj.name, obj.data.name = name + " (original)", mesh_name + " (original)"
    mesh.name = mesh_name
    copy = bpy.data.objects.new(name, mesh)
    copy.name = name
    keys = mesh.shape_keys
    if keys is not None:
        if keys.animation_data is not None:
            for curve in list(keys.animation_data.drivers):
                keys.animation_data.drivers.remove(curve)
        for key in shape_keys.driven_names(obj):
            copy.shape_key_remove(keys.key_blocks[key])
        if _LIVE in keys.key_blocks:
            copy.shape_key_remove(keys.key_blocks[_LIVE])
    return copy
