# SPDX-License-Identifier: GPL-3.0-or-later
"""Cleaning a scan: what is removed is counted, what cannot be a head is refused in one sentence."""

import numpy as np
import pytest

from headshop.sim.errors import InputError
from headshop.sim.mesh import Mesh
from headshop.sim.scan import whole_files
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.ply import read_ply
from headshop.sim.scan.whole_files import require_whole


def _dome(n=20):
    side = np.linspace(-1, 1, n)
    x, y = np.meshgrid(side, side, indexing="ij")
    points = 100 * np.stack([x, y, -(x**2) - y**2], axis=-1).reshape(-1, 3)
    i = np.arange(n * n).reshape(n, n)
    triangles = np.concatenate(
        [
            np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:]], -1).reshape(-1, 3),
            np.stack([i[:-1, :-1], i[1:, 1:], i[:-1, 1:]], -1).reshape(-1, 3),
        ]
    )
    return points, triangles


def test_a_clean_scan_stays_as_it_is():
    points, triangles = _dome()
    mesh, counts = clean_scan(Mesh.from_triangles(points, triangles))
    np.testing.assert_array_equal(mesh.vertices, points)
    np.testing.assert_array_equal(mesh.triangles, triangles)
    removed = {k: v for k, v in counts.items() if k not in ("vertices", "triangles", "components")}
    assert set(removed.values()) == {0}
    assert (counts["vertices"], counts["triangles"], counts["components"]) == (400, 722, 1)


def test_each_fault_is_removed_and_counted():
    points, triangles = _dome()
    n = len(points)
    colour = np.full((n, 3), 0.5, dtype=np.float32)
    extra = [
        [np.nan, 0, 0],
        [0, np.inf, 0],
        [500, 500, 500],
        points[7],
        points[0] + [0, 0, 900],
        points[0] + [9, 0, 900],
    ]
    extra += [points[0] + [0, 9, 900], points[0] + [4.5, 0, 900]]
    vertices = np.concatenate([points, extra])
    faces = np.concatenate(
        [
            triangles,
            [[0, 1, n]],  # NaN
            [[3, 3, 4]],  # twice the same corner
            [[n + 4, n + 7, n + 5]],  # three points on a line
            triangles[[5]][:, [1, 2, 0]],  # seen before
            triangles[[6]][:, [0, 2, 1]],  # seen before, turned round
            [[n + 4, n + 5, n + 6]],  # a speck: stays
        ]
    )
    faces[faces == 7] = np.where(np.arange((faces == 7).sum()) % 2, 7, n + 3)  # a seam through vertex 7
    colour = np.concatenate([colour, np.full((len(extra), 3), 0.5, dtype=np.float32)])
    colour[n + 3] = 0.75
    mesh, counts = clean_scan(Mesh.from_triangles(vertices, faces, colour=colour))
    assert counts == {
        "points": 0,
        "nonfinite_vertices": 2,
        "nonfinite_faces": 1,
        "welded_vertices": 1,
        "stray_vertices": 0,
        "zero_area_faces": 2,
        "duplicate_faces": 2,
        "turned_faces": 0,
        "sheets": 0,
        "sheets_apart": 0.0,
        "unused_vertices": 2,  # the lone point and the middle of the line
        "vertices": n + 3,
        "triangles": len(triangles) + 1,
        "components": 2,
    }
    assert np.isfinite(mesh.vertices).all()
    seam = np.flatnonzero((mesh.vertices == points[7]).all(axis=1))
    np.testing.assert_allclose(mesh.colour[seam], [[0.625] * 3])
    assert np.delete(mesh.colour, seam, axis=0).max() == 0.5


@pytest.mark.parametrize("away", [1_000.0, 1e6, 1e30])
@pytest.mark.parametrize("soup", [False, True])
def test_stray_vertices_are_dropped_with_their_faces(away, soup):
    points, triangles = _dome()
    whole, _ = clean_scan(Mesh.from_triangles(points, triangles))
    gone = np.isin(triangles, [150, 205]).any(axis=1)
    points[[150, 205]] += [[0, 0, away], [-away, 0, 9]]
    scan = Mesh.from_triangles(points, triangles)
    if soup:
        scan = Mesh.from_triangles(points[triangles].reshape(-1, 3), np.arange(3 * len(triangles)))
    mesh, counts = clean_scan(scan)
    assert (counts["stray_vertices"], counts["unused_vertices"], counts["vertices"]) == (2, 0, 398)
    assert counts["triangles"] == (~gone).sum() and np.isin(mesh.vertices, whole.vertices).all()


def test_a_wall_far_behind_is_no_stray():
    """Decimated to two triangles, with jumps drawn from the rim of the head to its corners."""
    points, triangles = _dome()
    wall = np.array([[-2000, -2000, -3000], [2000, -2000, -3000], [2000, 2000, -3000], [-2000, 2000, -3000.0]])
    rims = [np.arange(20) * 20, 380 + np.arange(20), np.arange(400)[::-20], np.arange(20)[::-1]]
    jumps = [[a, b, 400 + k] for k, rim in enumerate(rims) for a, b in zip(rim, rim[1:], strict=False)]
    corners = [[rim[-1], 400 + k, 400 + (k + 1) % 4] for k, rim in enumerate(rims)]
    faces = np.concatenate([triangles, jumps, corners])
    _, counts = clean_scan(Mesh.from_triangles(np.concatenate([points, wall]), faces))
    assert counts["stray_vertices"] == 0 and counts["triangles"] == len(faces)


def test_triangles_wound_the_other_way_than_their_neighbours_are_turned():
    points, triangles = _dome()
    wrong = np.random.default_rng(2).random(len(triangles)) < 0.3
    mixed = np.where(wrong[:, None], triangles[:, ::-1], triangles)
    mesh, counts = clean_scan(Mesh.from_triangles(points, mixed))
    assert counts["turned_faces"] == wrong.sum()
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_triangles_that_share_no_vertex_are_welded():
    points, triangles = _dome(60)
    soup = Mesh.from_triangles(points[triangles].reshape(-1, 3), np.arange(3 * len(triangles)))
    mesh, counts = clean_scan(soup)
    assert counts["vertices"] == len(points) and counts["components"] == 1
    np.testing.assert_array_equal(mesh.vertices[mesh.triangles], points[triangles])


def test_quads_are_taken_apart():
    points, _ = _dome()
    i = np.arange(400).reshape(20, 20)
    quads = np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]], -1).reshape(-1, 4).astype(np.int32)
    mesh, counts = clean_scan(Mesh(points, quads))
    assert counts["triangles"] == 722 and (mesh.faces[:, 3] == -1).all()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda p, t: (p[:0], t[:0]), "no vertices"),
        (lambda p, t: (p[:5], t[:0]), "no faces, and only 5 points"),
        (lambda p, t: (p * np.nan, t[:0]), "no faces, and only 0 points"),
        (lambda p, t: (p, t[:1]), "has 1 triangle, too few"),
        (lambda p, t: (p * np.nan, t), "all are NaN"),
        (lambda p, t: (p * 0, t), "no head in any unit"),
        (lambda p, t: (p * 1e20, t), "no head in any unit"),
        (lambda p, t: (p * [1, 1, 0], t), "is flat"),
        (lambda p, t: (p, t + 1), "does not exist"),
        (lambda p, t: (p, t[:, [0, 0, 1]]), "Only 0 usable triangles"),
    ],
)
def test_what_cannot_be_a_head_is_refused(change, says):
    points, triangles = _dome()
    with pytest.raises(InputError, match=says) as caught:
        clean_scan(Mesh.from_triangles(*change(points, triangles)))
    assert str(caught.value).endswith(".") and str(caught.value).count(". ") == 0


def test_a_scan_far_from_the_origin_is_refused_and_one_beside_it_is_not():
    """As georeferenced ones lie, whose heads would be stairs in Blender's numbers."""
    points, triangles = _dome()
    with pytest.raises(InputError, match="25,000 times its own size from the origin"):
        clean_scan(Mesh.from_triangles(points + [3e6, 4e6, 0], triangles))
    mesh, _ = clean_scan(Mesh.from_triangles(points + [1e5, 1e5, 0], triangles))
    np.testing.assert_allclose(mesh.vertices, points + [1e5, 1e5, 0])


@pytest.mark.parametrize(("kind", "says"), [("one_triangle", "1 triangle"), ("nan", "all are NaN")])
def test_bad_files_that_can_be_read(bad_scan, kind, says):
    with pytest.raises(InputError, match=says):
        clean_scan(read_ply(bad_scan(kind)))


@pytest.mark.parametrize("name", ["lps_infinite", "menpo_james", "fran_cyberware", "rvcg_dummyhead"])
def test_real_scans_pass(shared, name):
    raw = read_ply(shared / "scans" / f"{name}.ply")
    mesh, counts = clean_scan(raw)
    assert counts["triangles"] == len(raw.triangles) - counts["zero_area_faces"] - counts["duplicate_faces"]
    if name == "lps_infinite":
        assert counts["welded_vertices"] > 0 and counts["components"] == 1


_SOLID = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
_BINARY = b"solid, but not a text\0".ljust(80) + (2).to_bytes(4, "little") + bytes(100)
_OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 \\\n 3//1 # 9\nf -3 -2 -1\n"


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("a.stl", _SOLID + b"endsolid a\n", None),
        ("a.stl", _SOLID + b"END SOLID a with a long name\n\n" + _SOLID + b"endsolid", None),
        ("a.stl", _BINARY, None),
        ("a.stl", _SOLID, "cut off: it does not end with endsolid"),
        ("a.stl", _SOLID + b"endsolid a\n" + _SOLID[:60], "cut off: it does not end with endsolid"),
        ("a.stl", _BINARY[:-1], "cut off: it has 183 bytes of 184"),
        ("a.stl", b"v 1 2 3\n" * 99, "not an STL file"),
        ("a.stl", b"letter", "not an STL file"),
        ("a.obj", _OBJ, None),
        ("a.obj", _OBJ + b"f 1 2 4\n", "a face names a vertex"),
        ("a.obj", _OBJ + b"f 1 2 0\n", "a face names a vertex"),
        ("a.obj", _OBJ + b"f 1/9 2/9 -4/9\n", "a face names a vertex"),
        ("a.glb", b"glTF\2\0\0\0\x40\0\0\0", "cut off: it has 12 bytes of 64"),
        ("a.glb", b"glTF\2\0\0\0\x0c\0\0\0", None),
    ],
)
@pytest.mark.parametrize("block", [1, 1 << 24])
def test_files_that_are_not_whole_are_refused(tmp_path, monkeypatch, name, data, says, block):
    monkeypatch.setattr(whole_files, "_BLOCK", block)
    path = tmp_path / name
    path.write_bytes(data)
    if says is None:
        require_whole(path)
        return
    with pytest.raises(InputError, match=says):
        require_whole(path)
