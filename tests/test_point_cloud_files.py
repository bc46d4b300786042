# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of points: text as scanners write it, PCD, PLY without faces; and objects of points in the scene."""

import numpy as np
import pytest

from headshop.sim.errors import InputError
from headshop.sim.mesh import Mesh
from headshop.sim.mesh_subdivision import smoother
from headshop.sim.point_cloud.pcd_files import read_pcd
from headshop.sim.point_cloud.text_files import read_points
from headshop.sim.progress import finish
from headshop.sim.scan.ply import read_textured_ply, write_ply

XYZ = np.array([[1.5, -2, 3], [4, 5, -6.25], [0, 0.5, 7]])
RGB = np.array([[255, 0, 51], [0, 102, 255], [204, 153, 0]])
NORMAL = np.array([[0, 0.6, 0.8], [-1, 0, 0], [0, -0.6, -0.8]])
INTENSITY = np.array([[-1200.5], [3.25], [2047.5]])


def lines(*tables, parted=" ", header="", end="\n"):
    rows = np.concatenate(tables, axis=1).tolist()
    return header + "".join(parted.join(f"{value:g}" for value in row) + end for row in rows)


@pytest.mark.parametrize(
    ("text", "colour", "normals"),
    [
        (lines(XYZ), None, None),
        (lines(XYZ, parted=", "), None, None),
        (lines(XYZ, parted="\t", end="\r\n"), None, None),
        (lines(XYZ, end="\r"), None, None),
        (lines(XYZ, parted=";").replace(".", ","), None, None),
        (lines(XYZ, INTENSITY), None, None),
        (lines(XYZ, RGB), RGB, None),
        (lines(XYZ, RGB / 255), RGB, None),
        (lines(XYZ, RGB * 257), RGB, None),
        (lines(XYZ, NORMAL), None, NORMAL),
        (lines(XYZ, INTENSITY, RGB, header="3\n"), RGB, None),  # PTS
        (lines(XYZ, RGB, INTENSITY), RGB, None),
        (lines(XYZ, RGB, NORMAL), RGB, NORMAL),
        (lines(XYZ, NORMAL, RGB), RGB, NORMAL),
        (
            lines(XYZ, RGB, INTENSITY, NORMAL, header="//X Y Z R G B Intensity Nx Ny Nz\n3\n"),
            RGB,
            NORMAL,
        ),  # CloudCompare
        (lines(XYZ, RGB, parted=",", header='"x","y","z","red","green","blue"\n'), RGB, None),
        ("# a scan\n\n" + lines(XYZ[:2]) + "\n\n" + lines(XYZ[2:]) + "# its end\n", None, None),
    ],
)
def test_text(tmp_path, text, colour, normals):
    path = tmp_path / "a.xyz"
    path.write_bytes(text.encode())
    cloud = read_points(path)
    np.testing.assert_array_equal(cloud.vertices, XYZ)
    assert cloud.faces.shape == (0, 4)
    for read, wanted in ((cloud.colour, colour), (cloud.normals, normals)):
        if wanted is None:
            assert read is None
        else:
            np.testing.assert_allclose(read, wanted / 255 if wanted is RGB else wanted, atol=1e-5)


@pytest.mark.parametrize("text", ["Dear scanner,\nthis is a letter.\n", "1 2\n3 4\n", "\n"])
def test_text_without_points_is_refused(tmp_path, text):
    path = tmp_path / "a.txt"
    path.write_text(text)
    with pytest.raises(InputError, match="has no points") as caught:
        read_points(path)
    assert str(path) in str(caught.value) and str(caught.value).endswith(".")
    with pytest.raises(InputError, match="cannot be read"):
        read_points(tmp_path / "none.txt")


HEADER = """# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z rgb normal_x normal_y normal_z label
SIZE 4 4 4 4 4 4 4 2
TYPE F F F F F F F U
COUNT 1 1 1 1 1 1 1 2
WIDTH 3
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS 3
DATA """


def pcd(encoding: str) -> bytes:
    packed = (RGB @ [65536, 256, 1]).astype(np.uint32)
    names = [(name, "<f4") for name in ("x", "y", "z", "rgb", "nx", "ny", "nz")]
    rows = np.zeros(3, [*names, ("label", "<u2", 2)])
    for k, axis in enumerate("xyz"):
        rows[axis], rows["n" + axis] = XYZ[:, k], NORMAL[:, k]
    rows["rgb"] = packed.view(np.float32)
    if encoding == "binary":
        return (HEADER + "binary\n").encode() + rows.tobytes()
    text = [" ".join(f"{value:.9g}" for value in [*row.tolist()[:7], 1, 2]) for row in rows]
    return (HEADER + "ascii\n" + "\n".join(text) + "\n").encode()


@pytest.mark.parametrize("encoding", ["binary", "ascii"])
def test_pcd(tmp_path, encoding):
    path = tmp_path / "a.pcd"
    path.write_bytes(pcd(encoding))
    cloud = read_pcd(path)
    np.testing.assert_array_equal(cloud.vertices, XYZ)
    np.testing.assert_allclose(cloud.colour, RGB / 255, atol=1e-6)
    np.testing.assert_allclose(cloud.normals, NORMAL, atol=1e-6)
    path.write_bytes(pcd(encoding).replace(b" rgb normal_x normal_y normal_z label", b" a b c d e"))
    cloud = read_pcd(path)
    assert cloud.colour is None and cloud.normals is None and len(cloud.vertices) == 3


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda data: b"", "not a PCD file"),
        (lambda data: b"Dear scanner,\nthis is a letter.\n", "not a PCD file"),
        (lambda data: data[:-4], "truncated"),
        (lambda data: data.replace(b"DATA binary", b"DATA binary_compressed"), "compressed"),
        (lambda data: data.replace(b"TYPE F", b"TYPE Q"), "damaged header"),
        (lambda data: data.replace(b"SIZE 4 4", b"SIZE 4"), "damaged header"),
        (lambda data: data.replace(b"POINTS 3", b"POINTS -3"), "damaged header"),
        (lambda data: data.replace(b"POINTS 3", b"POINTS three"), "damaged header"),
        (lambda data: data.replace(b"POINTS 3", b"POINTS 0"), "has no points"),
        (lambda data: data.replace(b"FIELDS x", b"FIELDS q"), "has no points"),
    ],
)
def test_bad_pcd_files_get_one_sentence(tmp_path, change, says):
    path = tmp_path / "a.pcd"
    path.write_bytes(change(pcd("binary")))
    with pytest.raises(InputError, match=says) as caught:
        read_pcd(path)
    assert str(path) in str(caught.value) and str(caught.value).endswith(".")


def test_a_pcd_text_that_is_damaged(tmp_path):
    path = tmp_path / "a.pcd"
    for change, says in ((lambda d: d[:-9], "truncated"), (lambda d: d.replace(b"\n1.5 ", b"\none "), "no number")):
        path.write_bytes(change(pcd("ascii")))
        with pytest.raises(InputError, match=says):
            read_pcd(path)


def test_ply_without_faces(tmp_path, write_rows):
    vertices = [(*p, *n, *c) for p, n, c in zip(XYZ.tolist(), NORMAL.tolist(), RGB.tolist(), strict=True)]
    names = [f"float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")] + ["uchar red", "uchar green", "uchar blue"]
    cloud, pictures = read_textured_ply(
        write_rows(tmp_path / "a.ply", "binary_little_endian", {"vertex": (names, vertices)}, ())
    )
    np.testing.assert_array_equal(cloud.vertices, XYZ)
    np.testing.assert_allclose(cloud.normals, NORMAL, atol=1e-6)
    np.testing.assert_allclose(cloud.colour, RGB / 255, atol=1e-6)
    assert cloud.faces.shape == (0, 4) and pictures == () and cloud.uv is None
    plain = tmp_path / "b.ply"
    write_ply(plain, Mesh(XYZ, np.zeros((0, 4), np.int32)))
    assert read_textured_ply(plain)[0].normals is None


@pytest.mark.parametrize("name", ["a.ply", "a.xyz", "a.pcd", "a.obj", "a.glb"])
def test_every_kind_comes_in_as_points(bpy, tmp_path, name):
    from headshop.headshop_addon import bridge, scan_import

    path = tmp_path / name
    cloud = Mesh(XYZ, np.zeros((0, 4), np.int32))
    if name == "a.ply":
        write_ply(path, cloud)
    elif name == "a.obj":
        path.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in XYZ.tolist()))
    elif name == "a.glb":
        bpy.context.scene.collection.objects.link(bridge.mesh_to_object(cloud, "cloud"))
        bpy.ops.export_scene.gltf(filepath=str(path), export_format="GLB", use_mesh_vertices=True)
    else:
        path.write_bytes(lines(XYZ).encode() if name == "a.xyz" else pcd("binary"))
    read = scan_import.read_scan(path)
    wanted = XYZ[:, [0, 2, 1]] * [1, 1, -1] / 1000 if name == "a.glb" else XYZ
    np.testing.assert_allclose(read.vertices, wanted, atol=1e-6)
    assert len(read.faces) == 0


def test_landmarks_are_found_on_points(bpy, reference, tmp_path):
    """In metres, upside down, noisy, with colours, a point to a line."""
    from headshop.headshop_addon import pipeline

    rng = np.random.default_rng(11)
    operator, quads = smoother(reference.skin.faces, len(reference.skin.vertices), 2)
    inner = operator @ reference.groups["inner"].astype(float) > 0.5
    points = (operator @ reference.skin.vertices)[~inner]
    points = points + rng.normal(0, 0.1, points.shape)
    turned = points * [-1, 1, -1] / 1000
    path = tmp_path / "head.xyz"
    np.savetxt(path, np.concatenate([turned, np.tile([200, 150, 130], (len(turned), 1))], axis=1), fmt="%.6f")
    scan, found = finish(pipeline.load_scan_alone(path))
    assert scan.report["points"] == len(points) and scan.report["unit"] == "m" and scan.report["up"] == "-Z"
    assert np.abs(scan.mesh.colour - np.array([200, 150, 130]) / 255).max() < 0.01
    truth = reference.landmark_positions()
    off = {name: np.linalg.norm(place - truth[name]) for name, place in found.positions.items()}
    assert np.median(list(off.values())) < 1.5 and off["prn"] < 1.5


@pytest.mark.parametrize("kind", ["MESH", "POINTCLOUD"])
def test_objects_of_points_are_adopted(addon, reference, kind):
    from headshop.headshop_addon import bridge, heads, scan_objects

    colour = np.tile(np.float32([[0.8, 0.6, 0.5]]), (len(reference.skin.vertices), 1))
    cloud = Mesh(reference.skin.vertices, np.zeros((0, 4), np.int32), colour=colour)
    original = bridge.mesh_to_object(cloud, "Original")
    addon.context.scene.collection.objects.link(original)
    addon.context.view_layer.objects.active = original
    original.select_set(True)
    if kind == "POINTCLOUD":
        assert addon.ops.object.convert(target="POINTCLOUD") == {"FINISHED"}
    original = addon.context.active_object
    assert original.type == kind
    assert addon.ops.headshop.choose_scan() == {"FINISHED"}
    scan = addon.context.scene.headshop.scan
    assert scan.type == "MESH" and len(scan.data.polygons) > 2000
    mesh = bridge.object_to_mesh(scan)
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx(np.ptp(reference.skin.vertices, axis=0), rel=0.15)
    np.testing.assert_allclose(mesh.colour, colour[:1] + 0 * mesh.colour, atol=0.01)
    assert heads.read_report(scan)["scan"]["points"] == len(reference.skin.vertices)
    assert f"made of {len(reference.skin.vertices):,} points" in scan_objects.summary(scan)
