# SPDX-License-Identifier: GPL-3.0-or-later
"""PLY files that name pictures: places of faces on them, as each program writes them, and rows of any lengths."""

import numpy as np
import pytest

from headshop.sim.errors import InputError
from headshop.sim.scan import ply_body
from headshop.sim.scan.ply import FORMATS, read_ply, read_textured_ply

POINTS = [(x, y, 0.5 * x) for y in range(3) for x in range(3)]
XYZ = ["float x", "float y", "float z"]
CORNERS, PLACES = "list uchar int vertex_indices", "list uchar float texcoord"


def _place(corner):
    """Where on its picture a vertex of `POINTS` lies, exact in float32."""
    return corner % 3 / 4, corner // 3 / 8


def _listed(corners):
    return [number for corner in corners for number in _place(corner)]


def _check(mesh, faces):
    assert mesh.faces.tolist() == faces
    for corners, uv in zip(faces, mesh.uv, strict=True):
        assert uv.tolist() == [list(_place(corner)) if corner >= 0 else [0, 0] for corner in corners]


@pytest.mark.parametrize("encoding", FORMATS)
@pytest.mark.parametrize("names", [("s", "t"), ("u", "v"), ("texture_u", "texture_v")])
def test_places_of_vertices(tmp_path, write_rows, encoding, names):
    vertices = [*XYZ, *(f"float {name}" for name in names)], [(*p, *_place(k)) for k, p in enumerate(POINTS)]
    path = write_rows(
        tmp_path / "a.ply", encoding, {"vertex": vertices, "face": ([CORNERS], [([0, 1, 4],), ([0, 4, 3],)])}
    )
    mesh, pictures = read_textured_ply(path)
    _check(mesh, [[0, 1, 4, -1], [0, 4, 3, -1]])
    assert pictures == ("skin.png",) and mesh.material.tolist() == [0, 0]
    plain = read_ply(path)
    assert plain.uv is None and plain.material is None


@pytest.mark.parametrize("encoding", FORMATS)
@pytest.mark.parametrize("polygons", [[[0, 1, 4], [0, 4, 3]], [[0, 1, 4], [0, 1, 2, 5, 4, 3], [1, 2, 5, 4]]])
def test_places_of_corners(tmp_path, write_rows, encoding, polygons):
    """They come before those of vertices, which MeshLab writes too; rows of one length and of several."""
    vertices = [*XYZ, "float texture_u", "float texture_v"], [(*p, 0.9, 0.9) for p in POINTS]
    properties = ["uchar flags", CORNERS, PLACES, "uchar red"]
    rows = [(7, corners, _listed(corners), 9) for corners in polygons]
    mesh, _ = read_textured_ply(
        write_rows(tmp_path / "a.ply", encoding, {"vertex": vertices, "face": (properties, rows)})
    )
    fans = [[0, 1, 2, -1], [0, 2, 5, -1], [0, 5, 4, -1], [0, 4, 3, -1]]
    _check(mesh, [[0, 1, 4, -1], [0, 4, 3, -1]] if len(polygons) == 2 else [[0, 1, 4, -1], [1, 2, 5, 4], *fans])


@pytest.mark.parametrize("encoding", FORMATS)
def test_faces_show_the_picture_of_their_number_or_none(tmp_path, write_rows, encoding):
    triangles, numbers = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [3, 4, 7]], [1, 0, -1, 2, 0]
    places = [_listed(corners) for corners in triangles]
    places[1], places[4] = [], [np.nan if encoding != "ascii" else float("inf"), *places[4][1:]]
    rows = list(zip(triangles, places, numbers, strict=True))
    elements = {"vertex": (XYZ, POINTS), "face": ([CORNERS, PLACES, "int texnumber"], rows)}
    comments = "made by hand", "TextureFile my skin.png", "TextureFile Gesicht Å.jpg"
    mesh, pictures = read_textured_ply(write_rows(tmp_path / "a.ply", encoding, elements, comments))
    assert pictures == ("my skin.png", "Gesicht Å.jpg")
    assert mesh.material.tolist() == [1, 2, 2, 2, 2]
    assert mesh.uv[0, :3].tolist() == [list(_place(corner)) for corner in triangles[0]]
    assert not mesh.uv[1:].any()


def test_a_number_may_be_that_of_vertices(tmp_path, write_rows):
    vertices = [*XYZ, "float u", "float v", "int texnumber"], [(*p, *_place(k), k // 3) for k, p in enumerate(POINTS)]
    elements = {"vertex": vertices, "face": ([CORNERS], [([0, 1, 2],), ([3, 4, 5],)])}
    mesh, _ = read_textured_ply(write_rows(tmp_path / "a.ply", "ascii", elements, ["TextureFile a", "TextureFile b"]))
    assert mesh.material.tolist() == [0, 1]


def test_whole_numbers_of_a_text_that_are_none_or_too_large_are_the_nearest_that_are(tmp_path, write_rows):
    flags = [0, 300, 1e30, -5, np.nan, 255, 7, 8, 9]
    vertices = (
        [*XYZ, *(f"uchar {name}" for name in ("red", "green", "blue"))],
        [(*p, flag, 255, 0) for p, flag in zip(POINTS, flags, strict=True)],
    )
    mesh = read_ply(write_rows(tmp_path / "a.ply", "ascii", {"vertex": vertices, "face": ([CORNERS], [([0, 1, 4],)])}))
    np.testing.assert_allclose(mesh.colour[:, 0] * 255, [0, 255, 255, 0, 0, 255, 7, 8, 9], atol=1e-4)


@pytest.mark.parametrize("corners", [[0, 1, -1], [0, 1, 4, -1], [0, 1, 4, 3, -1], [0, 1, 9], [0, 1, -2]])
@pytest.mark.parametrize("encoding", FORMATS)
def test_faces_of_vertices_that_do_not_exist_are_refused(tmp_path, write_rows, encoding, corners):
    elements = {"vertex": (XYZ, POINTS), "face": ([CORNERS], [([0, 1, 4],), (corners,)])}
    with pytest.raises(InputError, match="does not exist"):
        read_ply(write_rows(tmp_path / "a.ply", encoding, elements))


def test_without_a_picture_or_without_places_nothing_is_said_of_any(tmp_path, write_rows):
    vertices = [*XYZ, "float s", "float t"], [(*p, *_place(k)) for k, p in enumerate(POINTS)]
    faces = [CORNERS], [([0, 1, 4],)]
    unnamed = write_rows(tmp_path / "a.ply", "ascii", {"vertex": vertices, "face": faces}, ["TextureFile"])
    placeless = write_rows(tmp_path / "b.ply", "ascii", {"vertex": (XYZ, POINTS), "face": faces})
    for path in (unnamed, placeless):
        mesh, _ = read_textured_ply(path)
        assert mesh.uv is None and mesh.material is None


@pytest.mark.parametrize("encoding", FORMATS)
def test_places_of_more_or_fewer_corners_are_refused(tmp_path, write_rows, encoding):
    for wrong in (_listed([0, 1]), _listed([0, 1, 4, 3]), _listed([0, 1, 4])[:-1]):
        rows = [([0, 4, 3], _listed([0, 4, 3])), ([0, 1, 4], wrong)]
        path = write_rows(tmp_path / "a.ply", encoding, {"vertex": (XYZ, POINTS), "face": ([CORNERS, PLACES], rows)})
        with pytest.raises(InputError, match="more or fewer corners") as caught:
            read_textured_ply(path)
        assert str(caught.value).count(".ply") == 1 and str(caught.value).endswith(".")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"float texcoord", b"texcoord"),
        (b"property list uchar float texcoord", b"property float texcoord"),
        (b"property float x", b"property list uchar float x"),
        (b"property list uchar int vertex_indices", b"property int vertex_indices"),
        (b"list uchar float", b"list char float"),
        (b"list uchar float", b"list float float"),
        (b"list uchar int", b"list uchar uint"),
        (b"element face", b"element nothing 3\nelement face"),
        (b"element face 3", b"element face 9"),
    ],
)
@pytest.mark.parametrize("encoding", FORMATS)
def test_headers_that_say_otherwise_are_read_or_refused_in_words(tmp_path, write_rows, encoding, old, new):
    rows = [(corners, _listed(corners)) for corners in ([0, 4, 3], [0, 1, 5, 4], [1, 2, 5])]
    path = write_rows(tmp_path / "a.ply", encoding, {"vertex": (XYZ, POINTS), "face": ([CORNERS, PLACES], rows)})
    assert old in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(old, new))
    try:
        read_textured_ply(path)
    except InputError as error:
        assert str(path) in str(error)


@pytest.mark.parametrize("encoding", FORMATS)
def test_rows_of_any_lengths_are_read_whatever_the_blocks_they_are_searched_in(
    tmp_path, write_rows, encoding, monkeypatch
):
    rng = np.random.default_rng(3)
    polygons = [rng.integers(0, 9, rng.integers(0, 7)).tolist() for _ in range(200)]
    rows = [(corners, k, _listed(corners)) for k, corners in enumerate(polygons)]
    elements = {"face": ([CORNERS, "double weight", PLACES], rows), "vertex": (XYZ, POINTS)}
    path = write_rows(tmp_path / "a.ply", encoding, elements)
    wanted = [
        [a, b, c, -1] for p in polygons if len(p) > 4 for a, b, c in zip(p[:1] * len(p), p[1:], p[2:], strict=False)
    ]
    wanted = [(p + [-1])[:4] for p in polygons if 3 <= len(p) <= 4] + wanted
    for block in (1, 7, 100, 1 << 16):
        monkeypatch.setattr(ply_body, "_BLOCK", block)
        mesh, _ = read_textured_ply(path)
        _check(mesh, wanted)
        np.testing.assert_array_equal(mesh.vertices, POINTS)


@pytest.mark.parametrize("encoding", FORMATS)
def test_every_cut_is_noticed(tmp_path, write_rows, encoding):
    rows = [(corners, _listed(corners)) for corners in ([0, 4, 3], [0, 1, 5, 4], [3, 4, 7], [1, 2, 5])]
    for some in (rows, rows[2:]):
        path = write_rows(tmp_path / "a.ply", encoding, {"vertex": (XYZ, POINTS), "face": ([CORNERS, PLACES], some)})
        data = path.read_bytes()
        for length in range(0, len(data) - 7, 5):
            path.write_bytes(data[:length])
            with pytest.raises(InputError):
                read_textured_ply(path)
