# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays survive the way into Blender and back; units change on the way."""

import numpy as np
import pytest

from headshop.sim.errors import InputError
from headshop.sim.mesh import Mesh


@pytest.fixture
def bridge(bpy):
    from headshop.headshop_addon import bridge

    return bridge


@pytest.fixture
def mesh():
    """Two quads and a triangle among loose vertices, with everything a mesh can carry."""
    rng = np.random.default_rng(5)
    uv = rng.random((3, 4, 2)).astype(np.float32)
    uv[1, 3] = 0
    return Mesh(
        rng.normal(size=(50, 3)) * 80,
        np.array([[0, 1, 2, 3], [4, 5, 6, -1], [7, 8, 9, 10]], np.int32),
        uv=uv,
        material=np.array([0, 1, 0], np.int16),
        colour=rng.random((50, 3)).astype(np.float32),
    )


def test_a_mesh_goes_round(bridge, mesh):
    back = bridge.object_to_mesh(bridge.mesh_to_object(mesh, "x"))
    np.testing.assert_allclose(back.vertices, mesh.vertices, atol=1e-4)
    np.testing.assert_array_equal(back.faces, mesh.faces)
    np.testing.assert_array_equal(back.material, mesh.material)
    np.testing.assert_allclose(back.uv, mesh.uv, atol=1e-6)
    np.testing.assert_allclose(back.colour, mesh.colour, atol=1e-3)


def test_objects_are_in_metres(bridge, mesh):
    obj = bridge.mesh_to_object(mesh, "x")
    np.testing.assert_allclose(obj.data.vertices[7].co, mesh.vertices[7] / 1000, atol=1e-7)


def test_polygons_of_five_corners_become_fans(bpy, bridge):
    data = bpy.data.meshes.new("pentagon")
    corners = [(np.cos(a), np.sin(a), 0) for a in np.linspace(0, 2 * np.pi, 5, endpoint=False)]
    data.from_pydata([*corners, (0, 0, 1)], [], [(0, 1, 2, 3, 4), (0, 1, 5), (1, 2, 3, 5)])
    faces = bridge.mesh_of(data).faces.tolist()
    assert faces == [[0, 1, 2, -1], [0, 2, 3, -1], [0, 3, 4, -1], [0, 1, 5, -1], [1, 2, 3, 5]]


def test_groups_go_round(bridge, mesh):
    rng = np.random.default_rng(6)
    groups = {"jaw": np.where(rng.random(50) > 0.5, rng.random(50), 0).astype(np.float32), "none": np.zeros(50)}
    obj = bridge.mesh_to_object(mesh, "x", groups)
    back = bridge.read_groups(obj)
    assert list(back) == ["jaw", "none"]
    np.testing.assert_allclose(back["jaw"], groups["jaw"])
    bridge.write_groups(obj, {"jaw": 1 - groups["jaw"]})
    np.testing.assert_allclose(bridge.read_groups(obj)["jaw"], 1 - groups["jaw"])


@pytest.mark.parametrize("values", [np.arange(50) % 3 == 0, np.linspace(-1, 1, 50), np.arange(50)])
def test_attributes_go_round(bridge, mesh, values):
    data = bridge.new_mesh(mesh, "x")
    bridge.write_attribute(data, "kept", np.zeros(50))
    bridge.write_attribute(data, "kept", values)
    back = bridge.read_attribute(data, "kept")
    assert back.dtype.kind == values.dtype.kind
    np.testing.assert_allclose(back, values, atol=1e-6)
    assert bridge.read_attribute(data, "absent") is None


def test_shape_keys_are_apart_from_the_basis(bridge, mesh):
    obj = bridge.mesh_to_object(mesh, "x")
    block = bridge.ensure_shape_key(obj, "smile")
    bridge.write_positions(obj, mesh.vertices + 3, "smile")
    assert block.value == 0 and bridge.ensure_shape_key(obj, "smile") == block
    np.testing.assert_allclose(bridge.read_positions(obj), mesh.vertices, atol=1e-4)
    np.testing.assert_allclose(bridge.read_positions(obj, "smile"), mesh.vertices + 3, atol=1e-4)


def test_only_meshes_are_meshes(bpy, bridge):
    with pytest.raises(InputError, match="not a mesh"):
        bridge.object_to_mesh(bpy.data.objects.new("empty", None))
