# SPDX-License-Identifier: GPL-3.0-or-later
"""The only place that moves arrays between Blender and numpy: metres there, millimetres here.

Everything goes through ``foreach_get`` / ``foreach_set``; vertex groups alone have no such access in Blender's API.
"""

import bpy
import numpy as np

from ..sim.errors import InputError
from ..sim.mesh import Mesh

METRES = 0.001  # one millimetre
_TYPES = {"f": ("FLOAT", "value", np.float32), "i": ("INT", "value", np.int32), "b": ("BOOLEAN", "value", bool)}


def _get(collection, field: str, width: int, dtype=np.float32) -> np.ndarray:
    """A property of every element of ``collection``: (n, width)."""
    flat = np.empty(len(collection) * width, dtype=dtype)
    collection.foreach_get(field, flat)
    return flat.reshape(-1, width) if width > 1 else flat


def _set(collection, field: str, values, dtype=np.float32) -> None:
    collection.foreach_set(field, np.ascontiguousarray(values, dtype=dtype).ravel())


def new_mesh(mesh: Mesh, name: str) -> bpy.types.Mesh:
    """A Blender mesh datablock with ``mesh``'s faces, positions (in metres), UVs, material indices and colours."""
    data = bpy.data.meshes.new(name)
    data.vertices.add(len(mesh.vertices))
    _set(data.vertices, "co", mesh.vertices * METRES)
    used = mesh.faces >= 0
    sizes = used.sum(axis=1)
    data.loops.add(int(sizes.sum()))
    data.polygons.add(len(mesh.faces))
    _set(data.loops, "vertex_index", mesh.faces[used], np.int32)
    _set(data.polygons, "loop_start", np.cumsum(sizes) - sizes, np.int32)
    data.update(calc_edges=True)
    if mesh.material is not None:
        _set(data.polygons, "material_index", mesh.material, np.int32)
    if mesh.uv is not None:
        _set(data.uv_layers.new(name="UVMap").uv, "vector", mesh.uv[used])
    if mesh.colour is not None:
        write_colour(data, mesh.colour)
    data.shade_smooth()
    return data


def mesh_to_object(mesh: Mesh, name: str, groups: dict[str, np.ndarray] | None = None) -> bpy.types.Object:
    """An object (in no collection yet) made of ``mesh``, smooth-shaded, with vertex groups (n,) of weights 0..1."""
    obj = bpy.data.objects.new(name, new_mesh(mesh, name))
    write_groups(obj, groups or {})
    return obj


def object_to_mesh(obj: bpy.types.Object, basis: bool = True) -> Mesh:
    """The object's own mesh without modifiers, in its local space, mm; n-gons are fanned into triangles.

    ``basis`` reads the first shape key where there are any; otherwise the mesh's own positions are read. A point cloud object
    gives a mesh without faces.

    Raises
    ------
    InputError : the object is neither.
    """
    if obj.type == "POINTCLOUD":
        points = _get(obj.data.attributes["position"].data, "vector", 3).astype(float) / METRES
        return Mesh(points, np.zeros((0, 4), np.int32), colour=read_colour(obj.data))
    if obj.type != "MESH":
        raise InputError(f"{obj.name} is a {obj.type.lower()} object, not a mesh: choose a mesh object.")
    vertices = read_positions(obj) if basis else _get(obj.data.vertices, "co", 3).astype(float) / METRES
    return mesh_of(obj.data, vertices)


def shown_mesh(obj: bpy.types.Object, graph: bpy.types.Depsgraph) -> Mesh:
    """The mesh or points of an object as the viewport shows them, with modifiers and shape keys, in its local space, mm.

    Raises
    ------
    InputError : it is neither a mesh nor a point cloud object.
    """
    shown = obj.evaluated_get(graph)
    if obj.type != "MESH":
        return object_to_mesh(shown)
    try:
        return mesh_of(shown.to_mesh(preserve_all_data_layers=True, depsgraph=graph))
    finally:
        shown.to_mesh_clear()


def scan_mesh(scan: bpy.types.Object) -> Mesh:
    """The mesh of a ``scan``, mm in its local space, as clicks meet it: with modifiers and shape keys that an artist gave it.

    A hidden one is shown while it is read: what is hidden has no modifiers.
    """
    if not scan.modifiers and scan.data.shape_keys is None:
        return object_to_mesh(scan)
    hidden = scan.hide_viewport, scan.hide_get()
    scan.hide_viewport = False
    scan.hide_set(False)
    try:
        return shown_mesh(scan, bpy.context.evaluated_depsgraph_get())
    finally:
        scan.hide_viewport = hidden[0]
        scan.hide_set(hidden[1])


def read_numbers(data: bpy.types.Mesh | bpy.types.PointCloud) -> dict[str, np.ndarray]:
    """Name -> (n,) float32: the attributes of vertices or points that are a number each."""
    kept = [a for a in data.attributes if a.data_type == "FLOAT" and a.domain == "POINT"]
    return {attribute.name: _get(attribute.data, "value", 1) for attribute in kept}


def mesh_of(data: bpy.types.Mesh, vertices: np.ndarray | None = None) -> Mesh:
    """A Blender mesh datablock as a `Mesh` (mm), optionally with other positions (n, 3) mm."""
    if vertices is None:
        vertices = _get(data.vertices, "co", 3).astype(float) / METRES
    corner_vertex = _get(data.loops, "vertex_index", 1, np.int32)
    sizes = _get(data.polygons, "loop_total", 1, np.int32)
    starts = _get(data.polygons, "loop_start", 1, np.int32)
    corners, polygon = _quads_of(starts, sizes)
    used = corners >= 0
    faces = np.where(used, corner_vertex[np.maximum(corners, 0)] if len(corner_vertex) else -1, -1).astype(np.int32)
    uv = material = None
    if data.uv_layers.active is not None and len(data.loops):
        uv = np.where(used[..., None], _get(data.uv_layers.active.uv, "vector", 2)[corners], np.float32(0))
    if len(data.polygons):
        material = _get(data.polygons, "material_index", 1, np.int32)[polygon].astype(np.int16)
    return Mesh(vertices, faces, uv=uv, material=material, colour=read_colour(data))


def _quads_of(starts: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Polygons as a table of corner indices (m, 4), -1 for a triangle's last; and the polygon each row came from."""
    rows, owner = [np.empty((0, 4), np.int32)], [np.empty(0, np.int64)]
    for size in np.unique(sizes):
        chosen = np.flatnonzero(sizes == size)
        first = starts[chosen, None]
        if size in (3, 4):
            quad = np.full((len(chosen), 4), -1)
            quad[:, :size] = first + np.arange(size)
            rows.append(quad)
            owner.append(chosen)
        elif size > 4:
            fan = np.arange(1, size - 1)
            tri = np.stack([np.broadcast_to(first, (len(chosen), size - 2)), first + fan, first + fan + 1], axis=-1)
            rows.append(np.concatenate([tri, np.full((*tri.shape[:2], 1), -1)], axis=-1).reshape(-1, 4))
            owner.append(np.repeat(chosen, size - 2))
    polygon = np.concatenate(owner)
    order = np.argsort(polygon, kind="stable")
    return np.concatenate(rows)[order], polygon[order]


def read_positions(obj: bpy.types.Object, key: str | None = None) -> np.ndarray:
    """(n, 3) mm: a shape key's positions; without ``key`` the basis, or the mesh's own where it has no shape keys."""
    keys = obj.data.shape_keys
    if keys is None:
        return _get(obj.data.vertices, "co", 3).astype(float) / METRES
    block = keys.key_blocks[key] if key is not None else keys.reference_key
    return _get(block.points, "co", 3).astype(float) / METRES


def read_some_positions(obj: bpy.types.Object, indices) -> np.ndarray:
    """(n, 3) mm: of a few vertices what `read_positions` tells of all, fast enough for every redraw."""
    keys = obj.data.shape_keys
    points = obj.data.vertices if keys is None else keys.reference_key.points
    return np.array([points[index].co for index in indices], dtype=float) / METRES


def write_positions(obj: bpy.types.Object, vertices: np.ndarray, key: str | None = None) -> None:
    """Set a shape key's positions (n, 3) mm; without ``key`` the mesh's own (and its basis)."""
    keys = obj.data.shape_keys
    if key is None:
        _set(obj.data.vertices, "co", vertices * METRES)
    if keys is not None:
        block = keys.key_blocks[key] if key is not None else keys.reference_key
        _set(block.points, "co", vertices * METRES)
    obj.data.update()


def ensure_shape_key(obj: bpy.types.Object, name: str) -> bpy.types.ShapeKey:
    """The object's relative shape key ``name``, made (after the basis) if it is not there; a new one has value 0."""
    if obj.data.shape_keys is None:
        obj.shape_key_add(name="Basis", from_mix=False)
        obj.data.shape_keys.use_relative = True
        obj.data.shape_keys.name = obj.name  # what its slot in an action is called
    blocks = obj.data.shape_keys.key_blocks
    if name in blocks:
        return blocks[name]
    block = obj.shape_key_add(name=name, from_mix=False)
    block.value = 0.0
    return block


def write_groups(obj: bpy.types.Object, groups: dict[str, np.ndarray]) -> None:
    """Set vertex groups from weights (n,) 0..1; a vertex of weight 0 is left out of the group."""
    for name, weights in groups.items():
        group = obj.vertex_groups.get(name) or obj.vertex_groups.new(name=name)
        weights = np.asarray(weights, dtype=np.float32)
        group.remove(np.flatnonzero(weights <= 0).tolist())
        for weight in np.unique(weights[weights > 0]):  # the API takes many vertices, but one weight, at a time
            group.add(np.flatnonzero(weights == weight).tolist(), float(weight), "REPLACE")


def read_groups(obj: bpy.types.Object) -> dict[str, np.ndarray]:
    """Vertex group name -> weights (n,) float32."""
    names = [group.name for group in obj.vertex_groups]
    table = np.zeros((len(names), len(obj.data.vertices)), dtype=np.float32)
    for vertex in obj.data.vertices:  # the API has no bulk access to weights
        for element in vertex.groups:
            table[element.group, vertex.index] = element.weight
    return dict(zip(names, table, strict=True))


def write_attribute(data: bpy.types.Mesh, name: str, values: np.ndarray) -> None:
    """Set a per-vertex attribute (n,) of floats, integers or booleans."""
    values = np.asarray(values)
    kind, field, dtype = _TYPES[values.dtype.kind]
    attribute = data.attributes.get(name)
    if attribute is not None and (attribute.data_type, attribute.domain) != (kind, "POINT"):
        data.attributes.remove(attribute)
        attribute = None
    if attribute is None:
        attribute = data.attributes.new(name, kind, "POINT")
    _set(attribute.data, field, values, dtype)


def read_attribute(data: bpy.types.Mesh, name: str) -> np.ndarray | None:
    """A per-vertex attribute (n,) or None."""
    attribute = data.attributes.get(name)
    if attribute is None or attribute.domain != "POINT":
        return None
    dtype = next((dtype for kind, _, dtype in _TYPES.values() if kind == attribute.data_type), None)
    return None if dtype is None else _get(attribute.data, "value", 1, dtype)


def read_vectors(data: bpy.types.Mesh, name: str) -> np.ndarray | None:
    """A per-vertex attribute (n, 3) of vectors or None."""
    attribute = data.attributes.get(name)
    if attribute is None or (attribute.data_type, attribute.domain) != ("FLOAT_VECTOR", "POINT"):
        return None
    return _get(attribute.data, "vector", 3)


def remove_attributes(data: bpy.types.Mesh, start: str) -> None:
    """Take away the attributes whose names begin with ``start``."""
    for name in [attribute.name for attribute in data.attributes if attribute.name.startswith(start)]:
        data.attributes.remove(data.attributes[name])


def add_uv(data: bpy.types.Mesh, name: str, uv: np.ndarray) -> None:
    """Add a UV map on which every vertex has one place (n, 2)."""
    corner_vertex = _get(data.loops, "vertex_index", 1, np.int32)
    _set(data.uv_layers.new(name=name).uv, "vector", uv[corner_vertex])


def write_colour(data: bpy.types.Mesh, colour: np.ndarray, name: str = "Color") -> None:
    """Set a per-vertex colour attribute from sRGB (n, 3) or (n, 4) values 0..1."""
    attribute = data.color_attributes.get(name) or data.color_attributes.new(name, "FLOAT_COLOR", "POINT")
    rgba = np.ones((len(colour), 4), dtype=np.float32)
    rgba[:, : np.shape(colour)[1]] = colour
    _set(attribute.data, "color_srgb", rgba)


def read_colour(data: bpy.types.Mesh | bpy.types.PointCloud, name: str | None = None) -> np.ndarray | None:
    """(n, 3) float32 sRGB of the named or the active colour attribute, or None; corner colours are averaged."""
    colours = data.color_attributes
    attribute = colours.get(name) if name else getattr(colours, "active_color", None)  # none is active of a point cloud
    if attribute is None and not name and len(colours):
        attribute = colours[0]
    if attribute is None or not len(attribute.data):
        return None
    rgb = _get(attribute.data, "color_srgb", 4)[:, :3]
    if attribute.domain == "CORNER":
        vertex = _get(data.loops, "vertex_index", 1, np.int32)
        count = np.maximum(np.bincount(vertex, minlength=len(data.vertices)), 1)
        sums = [np.bincount(vertex, rgb[:, k], minlength=len(data.vertices)) for k in range(3)]
        rgb = (np.stack(sums, axis=1) / count[:, None]).astype(np.float32)
    return rgb
