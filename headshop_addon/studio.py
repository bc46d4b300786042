# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene of its own to take pictures in: the artist's scene, keys, camera and settings are never touched."""

from contextlib import contextmanager

import bmesh
import bpy
import numpy as np

from ..sim.mesh import vertex_normals
from ..sim.scan.winding import faces_away
from . import heads
from .anatomy_materials import anatomy_material, scan_material
from .bridge import METRES, object_to_mesh, read_positions, write_positions
from .stage import Portrait, set_stage

BESIDE = 5.0  # mm from the skin to what a scan shows of it


@contextmanager
def studio(skin: bpy.types.Object, **stage):
    """A scene with lights and a camera for a head but nothing else in it; yields (scene, `Portrait`).

    Everything made inside, and whatever was linked to the scene alone, is gone afterwards. Options as for `set_stage`.
    """
    bpy.context.view_layer.update()  # matrix_world of objects that were just made
    known = {kind: set(getattr(bpy.data, kind)) for kind in _KINDS}
    scene = bpy.data.scenes.new("Head Shop Studio")
    try:
        yield scene, set_stage(scene, skin, **stage)
    finally:
        # What a renderer keeps for the next frame outlives its scene, and Blender reads it afterwards, out of freed memory.
        scene.render.use_persistent_data = False
        bpy.data.scenes.remove(scene)
        for kind in _KINDS:
            blocks = getattr(bpy.data, kind)
            bpy.data.batch_remove([block for block in blocks if block not in known[kind] and not block.users])


#: What a studio may leave behind, users first.
_KINDS = ("collections", "objects", "meshes", "lights", "cameras")


#: part -> set it is shown with; ``features`` are what is seen of a face beside its skin
_SETS = {
    "skin": "skin",
    "skull": "bones",
    "mandible": "bones",
    **dict.fromkeys(("eye_l", "eye_r", "teeth_upper", "teeth_lower", "tongue"), "features"),
}


class Model:
    """Copies of a head's parts, muscles and scan, to be posed and cut without touching the head."""

    def __init__(self, scene: bpy.types.Scene, skin: bpy.types.Object, frame: Portrait):
        self.skin, self.frame = skin, frame
        self.sets: dict[str, bpy.types.Collection] = {}
        self._shapes: dict[bpy.types.Object, dict[str, np.ndarray]] = {}
        self._parts: dict[str, bpy.types.Object] = {}
        for part, obj in heads.parts_of(skin).items():
            self._parts[part] = self._add(scene, _SETS[part], obj)
        for obj in heads.muscles_of(skin).values():
            self._add(scene, "muscles", obj)
        self.scan = heads.scan_of(skin)
        if self.scan is not None:
            _dress_scan(self._add(scene, "scan", self.scan), self._parts["skin"])
        (whole,) = self.sets["skin"].objects
        half = self._add(scene, "half", skin)
        _cut(half, whole.matrix_world.inverted(), frame)

    def _add(self, scene, name: str, obj: bpy.types.Object) -> bpy.types.Object:
        """A copy of ``obj`` without shape keys, parents, or anything that tells it is part of a head."""
        if name not in self.sets:
            self.sets[name] = bpy.data.collections.new("Head Shop Studio " + name)
            scene.collection.children.link(self.sets[name])
        copy = obj.copy()
        copy.data = bpy.data.meshes.new_from_object(obj)  # as it is before modifiers, without shape keys
        copy.animation_data_clear()
        for key in list(copy.keys()):
            del copy[key]
        copy.parent = None
        copy.matrix_world = obj.matrix_world
        copy.hide_render = False
        shapes = {"": read_positions(obj)}
        if obj.data.shape_keys is not None:
            shapes |= {block.name: read_positions(obj, block.name) for block in obj.data.shape_keys.key_blocks}
        self._shapes[copy] = shapes
        self.sets[name].objects.link(copy)
        write_positions(copy, shapes[""])
        return copy

    def show(self, *names: str) -> None:
        """Show these of ``skin half features bones muscles scan`` and hide the rest."""
        for name, collection in self.sets.items():
            collection.hide_render = name not in names

    def pose(self, key: str = "") -> None:
        """Put all parts into a shape key of the skin at full value; without one, to rest."""
        for name in ("skin", "features", "bones"):
            for obj in self.sets[name].objects:
                shapes = self._shapes[obj]
                write_positions(obj, shapes.get(key, shapes[""]))

    def move(self, deltas: dict[str, np.ndarray]) -> None:
        """Put parts at rest plus ``deltas`` (part -> (n, 3) mm in the skin's space); the parts not named stay."""
        for part, delta in deltas.items():
            copy = self._parts[part]
            turn = np.linalg.inv(heads.placement(self.skin, heads.parts_of(self.skin)[part])[:3, :3]).T
            write_positions(copy, self._shapes[copy][""] + delta @ turn)


def _cut(obj: bpy.types.Object, to_local, frame: Portrait) -> None:
    """Take away the subject's left half."""
    cut = bmesh.new()
    cut.from_mesh(obj.data)
    at = frame.centre + frame.left * 0.002 * frame.height
    normal = to_local.to_3x3() @ _vector(frame.left)
    everything = cut.verts[:] + cut.edges[:] + cut.faces[:]
    bmesh.ops.bisect_plane(cut, geom=everything, plane_co=to_local @ _vector(at), plane_no=normal, clear_outer=True)
    cut.to_mesh(obj.data)
    cut.free()


def _in_world(obj):
    """(n, 3) mm and unit normals (n, 3) of the vertices of ``obj``, as it is drawn: one that is mirrored is not turned."""
    mesh, matrix = object_to_mesh(obj), np.array(obj.matrix_world)
    vertices = mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3] / METRES
    return vertices, vertex_normals(vertices, mesh.triangles) * np.sign(np.linalg.det(matrix[:3, :3]))


def _vector(values):
    from mathutils import Vector

    return Vector(values)


def _dress_scan(copy: bpy.types.Object, skin: bpy.types.Object) -> None:
    """Show the outside of a scan, also of one that is wound inside out, in its own colours, or grey clay if it has neither
    colours nor a material."""
    (seen, out), (there, facing) = (_in_world(obj) for obj in (copy, skin))
    if faces_away(seen, out, there, facing, BESIDE):
        copy.data.flip_normals()
    materials = copy.data.materials
    if any(material is not None for material in materials):
        return
    materials.clear()
    colours = copy.data.color_attributes
    shown = colours.active_color or (colours[0] if len(colours) else None)
    materials.append(anatomy_material("scan") if shown is None else scan_material(shown.name))
