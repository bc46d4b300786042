# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects in the scene as one mesh, as the viewport shows them, with what colours them."""

import bpy
import numpy as np
from mathutils import Matrix

from ..sim.errors import InputError
from ..sim.mesh import Mesh
from ..sim.point_cloud.splats import are_splats, on_splats
from ..sim.scan.joined import joined
from . import bridge
from .scan_texture import with_pictures

ROUNDED = 1e-5  # between two scales that are one
FLAT = 1e-6  # part of its longest side that an object scaled to nothing is deep


def as_one(context, objects: list[bpy.types.Object]) -> tuple[Mesh, Matrix]:
    """What is shown of ``objects`` as one mesh in mm; and the matrix that puts it where they are: it turns, moves and scales in
    all directions alike, as the first of them does.

    Points without faces count only where nothing has any (`sim.scan.clean`).

    Raises
    ------
    InputError : the first is scaled to nothing.
    """
    graph = context.evaluated_depsgraph_get()
    place = _unstretched(objects[0])
    back = np.linalg.inv(np.array(place))
    meshes = []
    for obj in objects:
        matrix = back @ np.array(obj.matrix_world)
        mesh = _shown(obj, graph)
        if not np.allclose(matrix, np.eye(4), rtol=0, atol=ROUNDED):
            mesh = mesh.transformed(matrix[:3, :3])
            mesh = mesh.moved(mesh.vertices + matrix[:3, 3] / bridge.METRES)
        meshes.append(mesh)
    return joined(meshes), place


def _shown(obj, graph) -> Mesh:
    """Of splats that were imported as points, with their numbers as attributes, points on them."""
    mesh = bridge.shown_mesh(obj, graph)
    shown = obj.evaluated_get(graph)
    if len(mesh.faces):
        return with_pictures(mesh, shown)
    numbers = bridge.read_numbers(shown.data)
    if not are_splats(numbers):
        return mesh
    cloud = on_splats(mesh.vertices * bridge.METRES, numbers)
    return cloud.moved(cloud.vertices / bridge.METRES)


def _unstretched(obj) -> Matrix:
    """Where ``obj`` is, without what makes it wider than high or mirrored."""
    world = np.array(obj.matrix_world)
    left, sizes, right = np.linalg.svd(world[:3, :3])
    if sizes[2] < FLAT * sizes[0]:
        raise InputError(f"{obj.name} has a scale of 0 in some direction: give it another scale, or apply it.")
    scale = np.cbrt(sizes.prod())
    mirrored = np.sign(np.linalg.det(world[:3, :3]))
    if mirrored > 0 and np.ptp(sizes) < ROUNDED * scale:
        return obj.matrix_world.copy()
    whole = np.eye(4)
    whole[:3, :3] = scale * left @ right * mirrored
    whole[:3, 3] = world[:3, 3]
    return Matrix(whole.tolist())
