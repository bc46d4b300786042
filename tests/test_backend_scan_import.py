# SPDX-License-Identifier: GPL-3.0-or-later
"""Scans of every kind come in with the same shape and leave the scene as it was."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.errors import InputError
from headshop.sim.health.topology import volume
from headshop.sim.mesh import Mesh
from headshop.sim.scan.ply import write_ply


@pytest.fixture
def bowl():
    """A patch like a bowl, of no symmetry, in mm."""
    x, y = np.meshgrid(np.linspace(-70, 60, 12), np.linspace(-90, 80, 14))
    vertices = np.stack([x, 0.004 * (x**2 + y**2), y], axis=-1).reshape(-1, 3)
    i = (np.arange(13)[:, None] * 12 + np.arange(11)).ravel()
    return Mesh.from_triangles(
        vertices, np.concatenate([np.stack([i, i + 1, i + 12], 1), np.stack([i + 1, i + 13, i + 12], 1)])
    )


_WRITERS = {
    ".obj": lambda bpy, path: bpy.ops.wm.obj_export(filepath=path, forward_axis="Y", up_axis="Z"),
    ".stl": lambda bpy, path: bpy.ops.wm.stl_export(filepath=path),
    ".glb": lambda bpy, path: bpy.ops.export_scene.gltf(filepath=path, export_format="GLB"),
    ".gltf": lambda bpy, path: bpy.ops.export_scene.gltf(filepath=path, export_format="GLTF_SEPARATE"),
    ".usdc": lambda bpy, path: bpy.ops.wm.usd_export(filepath=path),
    ".fbx": lambda bpy, path: bpy.ops.export_scene.fbx(filepath=path),
}


@pytest.mark.parametrize("extension", _WRITERS)
def test_every_format(bpy, tmp_path, bowl, extension):
    from headshop.headshop_addon import bridge, scan_import

    path = str(tmp_path / f"scan{extension}")
    obj = bridge.mesh_to_object(bowl, "bowl")
    bpy.context.scene.collection.objects.link(obj)
    _WRITERS[extension](bpy, path)
    bpy.context.view_layer.objects.active = obj
    before = scan_import.datablocks()
    scan = scan_import.read_scan(path)
    assert scan_import.datablocks() == before
    assert bpy.context.view_layer.objects.active == obj and bpy.context.scene.objects.keys() == ["bowl"]
    assert len(scan.triangles) == len(bowl.triangles)
    wanted = bowl.vertices / 1000
    if extension in (".glb", ".gltf"):
        wanted = wanted[:, [0, 2, 1]] * [1, 1, -1]  # such files are Y up, and stay so
    distance, _ = cKDTree(scan.vertices).query(wanted)
    assert distance.max() < 1e-5 and len(scan.vertices) <= 6 * len(wanted)


def test_ply_with_colours(bpy, tmp_path, bowl):
    from dataclasses import replace

    from headshop.headshop_addon import scan_import

    colour = np.tile(np.linspace(0, 1, len(bowl.vertices), dtype=np.float32)[:, None], 3)
    write_ply(tmp_path / "scan.PLY", replace(bowl, colour=colour))
    scan = scan_import.read_scan(tmp_path / "scan.PLY")
    np.testing.assert_allclose(scan.vertices, bowl.vertices, atol=1e-4)
    np.testing.assert_allclose(scan.colour, colour, atol=0.003)


def test_several_objects_are_joined_where_they_stand(bpy, tmp_path, bowl):
    from headshop.headshop_addon import bridge, scan_import

    for shift in (0.0, 0.3):
        obj = bridge.mesh_to_object(bowl, "bowl")
        obj.location.x = shift
        bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.update()
    bpy.ops.export_scene.gltf(filepath=str(tmp_path / "two.glb"), export_format="GLB")
    scan = scan_import.read_scan(tmp_path / "two.glb")
    assert len(scan.triangles) == 2 * len(bowl.triangles)
    assert np.ptp(scan.vertices[:, 0]) == pytest.approx(0.43, abs=1e-4)


@pytest.mark.parametrize("extension", [".glb", ".usdc", ".fbx"])
def test_a_mirrored_object_in_a_file_keeps_its_outside(bpy, tmp_path, reference, extension):
    from headshop.headshop_addon import bridge, scan_import

    eye = reference.parts["eye_l"]
    obj = bridge.mesh_to_object(eye, "eye")
    bpy.context.scene.collection.objects.link(obj)
    obj.scale.x = -1
    bpy.context.view_layer.update()
    path = tmp_path / f"mirrored{extension}"
    _WRITERS[extension](bpy, str(path))
    scan = scan_import.read_scan(path)
    assert scan.vertices[:, 0].mean() == pytest.approx(-eye.vertices[:, 0].mean() / 1000, rel=0.02)
    assert volume(scan) == pytest.approx(volume(eye) * 1e-9, rel=1e-3)


def test_a_binary_stl_that_is_cut_off(bpy, tmp_path, bowl):
    from headshop.headshop_addon import bridge, scan_import

    bpy.context.scene.collection.objects.link(bridge.mesh_to_object(bowl, "bowl"))
    path = tmp_path / "scan.stl"
    bpy.ops.wm.stl_export(filepath=str(path))
    path.write_bytes(path.read_bytes()[:-70])
    with pytest.raises(InputError, match="cut off"):
        scan_import.read_scan(path)


def test_why_a_usd_file_cannot_be_read_is_said(bpy, tmp_path):
    from headshop.headshop_addon import scan_import

    path = tmp_path / "scan.usdc"
    path.write_bytes(b"PXR-USDC" + bytes(200))
    with pytest.raises(InputError, match="cannot be read as USDC") as caught:
        scan_import.read_scan(path)
    assert "console" not in str(caught.value)
