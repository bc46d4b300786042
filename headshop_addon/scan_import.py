# SPDX-License-Identifier: GPL-3.0-or-later
"""Scan files to arrays: PLY and cylindrical range maps by our own readers, the rest through Blender's importers.

Blender's PLY importer accepts truncated files without a word, so PLY does not go through it. Its importers work in a
scene of their own: the current scene, its selection and all datablocks are left as they were.
"""

from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np

from ..sim.cylindrical.grid_mesh import to_mesh
from ..sim.cylindrical.map_files import EXTENSIONS as MAPS
from ..sim.cylindrical.map_files import is_range_map, read_range_map
from ..sim.errors import InputError
from ..sim.mesh import Mesh
from ..sim.point_cloud.pcd_files import read_pcd
from ..sim.point_cloud.text_files import EXTENSIONS as POINTS
from ..sim.point_cloud.text_files import read_points
from ..sim.scan.joined import joined
from ..sim.scan.ply import read_textured_ply
from ..sim.scan.whole_files import require_whole
from . import bridge
from .quiet import quiet
from .scan_texture import picture_beside, with_pictures

# Landmarks are given in the file's own axes, so OBJ and STL come in unturned, and glTF is turned back (`_FILE_AXES`).
_RAW_AXES = {"forward_axis": "Y", "up_axis": "Z"}


def _import_obj(path):
    bpy.ops.wm.obj_import(filepath=path, **_RAW_AXES)


def _import_stl(path):
    bpy.ops.wm.stl_import(filepath=path, **_RAW_AXES)


def _import_gltf(path):
    if not hasattr(bpy.types, "IMPORT_SCENE_OT_gltf"):
        raise InputError(
            "Blender's glTF add-on is off: switch it on in Preferences, Add-ons, or convert the scan to PLY."
        )
    bpy.ops.import_scene.gltf(filepath=path)


def _import_usd(path):
    bpy.ops.wm.usd_import(filepath=path, set_frame_range=False, import_cameras=False, import_lights=False)


def _import_fbx(path):
    bpy.ops.wm.fbx_import(filepath=path)


_IMPORTERS = {
    ".obj": _import_obj,
    ".stl": _import_stl,
    **dict.fromkeys((".glb", ".gltf"), _import_gltf),
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), _import_usd),
    ".fbx": _import_fbx,
}
#: Blender's axes back to the file's, where they are known to differ: glTF is Y up.
_FILE_AXES = dict.fromkeys((".glb", ".gltf"), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]))
_READERS = {".pcd": read_pcd, **dict.fromkeys(POINTS, read_points)}
EXTENSIONS = (".ply", *_IMPORTERS, *MAPS, *_READERS)


def check_file(path) -> Path:
    """The path, if a scan may be there: it exists, is a file with something in it, and of a kind that is read.

    Raises
    ------
    InputError : it is not.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{path} is a folder: give the scan file in it.")
    if not path.is_file():
        raise InputError(f"There is no file {path}: check the name of the scan.")
    if path.suffix.lower() not in EXTENSIONS and not is_range_map(path):
        kinds = ", ".join(extension[1:].upper() for extension in EXTENSIONS)
        raise InputError(f"{path.name} is not of a kind that is read ({kinds}): export the scan as one of them.")
    if path.stat().st_size == 0:
        raise InputError(f"{path} is empty (0 bytes): export the scan again.")
    return path


def read_scan(path) -> Mesh:
    """All meshes of a scan file as one, in the file's own units and axes (USD and FBX: in metres, Z up).

    A range map becomes the mesh of its texels in mm, Z up, its voids and jumps as holes (`sim.cylindrical`); points without
    faces stay so (`sim.point_cloud`).

    Raises
    ------
    InputError : missing, empty, truncated, of an unknown kind, not what its name says, or without points.
    """
    path = check_file(path)
    extension = path.suffix.lower()
    if extension == ".ply":
        return _read_ply(path)
    if is_range_map(path):
        return to_mesh(read_range_map(path))
    if extension in _READERS:
        return _READERS[extension](path)
    require_whole(path)
    with _scratch_scene() as scene:
        with quiet() as printed:
            try:
                _IMPORTERS[extension](str(path.resolve()))
            except RuntimeError as error:
                reason = _reason(error, printed())
                raise InputError(
                    f"{path} cannot be read as {extension[1:].upper()} ({reason}): export the scan again."
                ) from error
        meshes = _meshes_of(scene)
    if not meshes:
        raise InputError(f"{path} holds no mesh that can be read as {extension[1:].upper()}: export the scan again.")
    scan = joined(meshes)
    return scan.moved(scan.vertices @ _FILE_AXES[extension].T) if extension in _FILE_AXES else scan


def _read_ply(path: Path) -> Mesh:
    """The mesh of a PLY file with the pictures that it names, so far as they lie beside it and can be read."""
    mesh, names = read_textured_ply(path)
    if mesh.uv is None:
        return mesh
    with quiet():
        pictures = tuple(picture_beside(path, name) for name in names)
    none = (None,) if mesh.material.max() == len(names) else ()  # for the faces that show none
    return joined([replace(mesh, pictures=(*pictures, *none))])


def _reason(error: Exception, printed: str) -> str:
    """The last thing said about an error, without Blender's prefixes; of USD's, which come before Blender's, the first."""
    lines = [line.strip() for line in f"{printed}\n{error}".splitlines() if line.strip()]
    first = next((line for line in lines if line.startswith("Runtime Error: in ") and " -- " in line), None)
    if first is not None:
        return first.partition(" -- ")[2].rstrip(".")[:160]
    said = next((line for line in reversed(lines) if "rror" in line), lines[-1] if lines else "no reason given")
    return said.rpartition("Error: ")[2].rstrip(".").strip().removesuffix(", see console for detail")[:160]


@contextmanager
def _scratch_scene():
    """A scene of its own as the context's, and after it every datablock that appeared is removed."""
    before = datablocks()
    scene = bpy.data.scenes.new("Head Shop import")
    try:
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0], collection=scene.collection):
            yield scene
    finally:
        bpy.data.batch_remove(datablocks() - before)


def datablocks() -> set:
    """Every datablock of the file."""
    return {
        block
        for prop in bpy.data.bl_rna.properties
        if prop.type == "COLLECTION" and isinstance(prop.fixed_type, bpy.types.bpy_struct)
        for block in getattr(bpy.data, prop.identifier)
        if isinstance(block, bpy.types.ID)
    }


def _meshes_of(scene) -> list[Mesh]:
    """Every mesh object of the scene with its transforms applied, in Blender's units as they are: those with faces, or if
    there are none, those of points alone."""
    graph = scene.view_layers[0].depsgraph
    graph.update()
    meshes = []
    objects = [obj for obj in scene.objects if obj.type == "MESH" and len(obj.data.vertices)]
    for obj in [obj for obj in objects if len(obj.data.polygons)] or objects:
        mesh = with_pictures(bridge.object_to_mesh(obj), obj)
        matrix = np.array(obj.evaluated_get(graph).matrix_world)
        mesh = mesh.transformed(bridge.METRES * matrix[:3, :3])
        meshes.append(mesh.moved(mesh.vertices + matrix[:3, 3]))
    return meshes
