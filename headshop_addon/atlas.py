# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin's UV islands packed into one square without wasting room, by xatlas."""

import bpy
import numpy as np

from ..sim.errors import InputError
from ..sim.mesh import Mesh
from . import bridge

LAYER = "Atlas"


def packed(mesh: Mesh, resolution: int = 2048, padding: int = 4) -> tuple[np.ndarray, float]:
    """UVs (m, 4, 2) of the mesh's own islands, turned and packed into 0..1, and the share of the square they fill.

    Raises
    ------
    InputError : the mesh has no UVs, or an island cannot be packed.
    """
    import xatlas

    if mesh.uv is None:
        raise InputError("The mesh has no UVs to pack: unwrap it first.")
    used = mesh.faces >= 0
    corners = np.column_stack([mesh.faces[used], mesh.uv[used].round(6)])
    _, first, index = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    uv = np.ascontiguousarray(mesh.uv[used][first], dtype=np.float32)
    corner = np.full(mesh.faces.shape, -1, dtype=np.int64)
    corner[used] = index.ravel()
    triangles = Mesh(np.zeros((len(uv), 3)), corner.astype(np.int32)).triangles.astype(np.uint32)
    atlas = xatlas.Atlas()
    atlas.add_uv_mesh(uv, triangles)
    options = xatlas.PackOptions()
    options.resolution, options.padding, options.bilinear = resolution, padding, True
    atlas.generate(pack_options=options)
    if atlas.atlas_count != 1:
        raise InputError(f"The UVs do not fit into one square of {resolution} pixels: choose a larger resolution.")
    origin, out, new = atlas.get_mesh(0)
    if len(out) != len(triangles) or not np.array_equal(origin[out], triangles):
        raise InputError("Some UV islands have no area and cannot be packed: unwrap the mesh anew.")
    placed = np.zeros((len(uv), 2), dtype=np.float32)
    size = np.array([atlas.width, atlas.height], dtype=np.float32)
    side = size.max()  # xatlas trims the square and stretches what is left to 0..1: undo that, or islands are distorted
    placed[triangles] = new[out] * (size / side)  # both triangles of a quad lie in one island: shared corners agree
    result = np.zeros(mesh.uv.shape, dtype=np.float32)
    result[used] = placed[corner[used]]
    return result, float(atlas.utilization * size.prod() / side**2)


def repack(obj: bpy.types.Object, resolution: int = 2048) -> float:
    """Write the packed UVs to the object's UV layer Atlas and make it the active one; returns the share filled."""
    mesh = bridge.object_to_mesh(obj)
    uv, share = packed(mesh, resolution)
    layers = obj.data.uv_layers
    layer = layers.get(LAYER) or layers.new(name=LAYER)
    layer.uv.foreach_set("vector", np.ascontiguousarray(uv[mesh.faces >= 0], dtype=np.float32).ravel())
    layers.active = layers[LAYER]
    obj.data.update()
    return share
