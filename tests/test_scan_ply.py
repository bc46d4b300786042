# SPDX-License-Identifier: GPL-3.0-or-later
"""PLY files: what is written is read again; what is damaged is refused in one sentence."""

import numpy as np
import pytest

from headshop.sim.errors import InputError
from headshop.sim.mesh import Mesh
from headshop.sim.scan.ply import FORMATS, read_ply, write_ply


def _mixed():
    points = np.random.default_rng(1).normal(size=(30, 3)) * 100
    faces = np.array([[0, 1, 2, -1], [3, 4, 5, 6], [7, 8, 9, -1], [10, 11, 12, 13]], dtype=np.int32)
    return Mesh(points, faces, colour=(np.arange(90).reshape(30, 3) / 255).astype(np.float32))


@pytest.mark.parametrize("encoding", FORMATS)
@pytest.mark.parametrize("kind", ["triangles", "quads", "mixed", "plain"])
def test_what_is_written_is_read_again(tmp_path, encoding, kind):
    mesh = _mixed()
    faces = {"triangles": mesh.faces[[0, 2]], "quads": mesh.faces[[1, 3]]}.get(kind, mesh.faces)
    mesh = Mesh(mesh.vertices, faces, colour=None if kind == "plain" else mesh.colour)
    write_ply(tmp_path / "a.ply", mesh, encoding, comments=("millimetres",))
    again = read_ply(tmp_path / "a.ply")
    np.testing.assert_allclose(again.vertices, mesh.vertices, rtol=1e-6)
    np.testing.assert_array_equal(again.faces, mesh.faces)
    if kind == "plain":
        assert again.colour is None
    else:
        np.testing.assert_allclose(again.colour, mesh.colour, atol=1e-6)
    assert [p.name for p in tmp_path.iterdir()] == ["a.ply"]


def test_polygons_become_fans_and_other_columns_are_passed_over(tmp_path):
    path = tmp_path / "a.ply"
    path.write_text(
        "ply\r\nformat ascii 1.0\r\nelement vertex 5\r\nproperty double x\r\n"
        "property double y\r\nproperty float confidence\r\nproperty double z\r\nelement face 2\r\n"
        "property uchar flag\r\nproperty list uchar int vertex_index\r\n"
        "element edge 1\r\nproperty int a\r\nproperty int b\r\nend_header\r\n"
        "0 0 9 0\r\n1 0 9 0\r\n2 1 9 0\r\n1 2 9 5\r\n0 1 9 0\r\n7 5 0 1 2 3 4\r\n7 3 0 1 2\r\n0 1\r\n"
    )
    mesh = read_ply(path)
    np.testing.assert_array_equal(mesh.vertices[3], [1, 2, 5])
    assert sorted(map(tuple, mesh.faces.tolist())) == [(0, 1, 2, -1), (0, 1, 2, -1), (0, 2, 3, -1), (0, 3, 4, -1)]


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        ("empty", "is empty"),
        ("text", "not a PLY file"),
        ("missing", "cannot be read"),
        ("truncated", "truncated"),
        ("nothing", "neither faces nor points"),
    ],
)
def test_bad_files_get_one_sentence(bad_scan, kind, says):
    path = bad_scan(kind)
    with pytest.raises(InputError, match=says) as caught:
        read_ply(path)
    assert str(path) in str(caught.value)
    assert str(caught.value).endswith(".") and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (b"element vertex 400", b"element vertex 4000000000", "promises 4000000000"),
        (b"element face 361", b"element face -1", "promises -1"),
        (b"element vertex 400", b"element vertex many", "damaged header"),
        (b"binary_little_endian", b"binary_middle_endian", "unknown encoding"),
        (b"property float x", b"property float q", "without x, y and z"),
        (b"property float x", b"property uint packed_position", "compressed Gaussian splats: export"),
        (b"end_header", b"end_of_it", "within its header"),
    ],
)
def test_damaged_headers_get_one_sentence(bad_scan, old, new, says):
    path = bad_scan("whole")
    data = path.read_bytes()
    assert old in data
    path.write_bytes(data.replace(old, new))
    with pytest.raises(InputError, match=says):
        read_ply(path)


@pytest.mark.parametrize("encoding", FORMATS)
def test_every_cut_is_noticed(tmp_path, encoding):
    path = tmp_path / "a.ply"
    write_ply(path, _mixed(), encoding)
    data = path.read_bytes()
    for length in range(0, len(data) - 3, 7):
        path.write_bytes(data[:length])
        with pytest.raises(InputError):
            read_ply(path)


def test_a_face_of_a_vertex_that_is_not_there(tmp_path):
    write_ply(tmp_path / "a.ply", Mesh(np.eye(3), np.array([[0, 1, 7, -1]], dtype=np.int32)))
    with pytest.raises(InputError, match="does not exist"):
        read_ply(tmp_path / "a.ply")


def test_writing_where_nothing_can_be_written(tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        write_ply(tmp_path / "absent" / "a.ply", _mixed())
    assert not any(tmp_path.iterdir())
