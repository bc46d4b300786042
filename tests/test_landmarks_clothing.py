# SPDX-License-Identifier: GPL-3.0-or-later
"""Clothes about the neck are told by their colour, left out, and neither shape nor stain the neck."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.adapt.build import build_head
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.landmarks import read_landmarks
from headshop.sim.adapt.scan_surface import NO_SKIN
from headshop.sim.landmarks.clothing import clothing_over
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.mesh import Mesh, vertex_normals
from headshop.sim.progress import finish
from headshop.sim.scan.clean import clean_scan

SKIN = np.array([0.75, 0.55, 0.45])
CLOTHS = {"white": (0.9, 0.9, 0.88), "black": (0.06, 0.06, 0.065), "navy": (0.1, 0.14, 0.3), "red": (0.6, 0.08, 0.1)}
CLOTHS["brown"] = 0.12 * SKIN


@pytest.fixture(scope="module")
def dressed(reference, seen_skin, laid):
    """``dressed(cloth, where)`` -> of the reference's skin in unevenly lit colours, with cloth of that colour ``where`` (n,)
    bool its vertices are: what is left out (m,) bool, the surface and the scan."""
    space, (target, _) = shape_space(reference), seen_skin()
    head = laid(space, reference.skin.vertices[space.vertices])

    def make(cloth, where, scan=None):
        colour = np.where(where[:, None], cloth, SKIN) * _light(target.vertices)
        scan = scan or Mesh.from_triangles(target.vertices, target.triangles, colour=np.clip(colour, 0, 1))
        return clothing_over(space, head, target, scan), target, scan

    return make


def _light(points):
    """(n, 1) half as light on one side as on the other, with a little noise."""
    noise = np.random.default_rng(2).normal(0, 0.02, (len(points), 1))
    return np.clip(0.75 + points[:, :1] / 300, 0.5, 1) + noise


def _shirt(reference, points):
    """(n,) bool: below a collar that rises from before the neck to behind it."""
    at = reference.landmark_positions()["gn"]
    return points[:, 2] < at[2] - 45 + 0.35 * (points[:, 1] - at[1])


def _wholly(target, where):
    """(m,) bool: the triangles all of whose corners are ``where`` (n,) bool, and those none of whose corners are near those."""
    away = cKDTree(target.vertices[where]).query(target.vertices)[0]
    return where[target.triangles].all(axis=1), (away[target.triangles] > 16).all(axis=1)


@pytest.mark.parametrize("cloth", CLOTHS)
def test_a_shirt_is_left_out_and_the_skin_above_it_is_not(reference, seen_skin, dressed, cloth):
    where = _shirt(reference, seen_skin()[0].vertices)
    out, target, _ = dressed(CLOTHS[cloth], where)
    cloth, skin = _wholly(target, where)
    assert min(cloth.sum(), skin.sum()) > 300
    assert out[cloth].all() and not out[skin].any()


def test_skin_is_no_clothing(reference, seen_skin, dressed):
    """Nor is it in the shade, nor a tattoo, nor what looks like skin, nor anything without a colour."""
    points = seen_skin()[0].vertices
    shirt, none, target = _shirt(reference, points), np.zeros(len(points), dtype=bool), seen_skin()[0]
    assert not dressed(SKIN, none)[0].any()
    assert not dressed(0.5 * SKIN, shirt)[0].any()
    tattoo = np.linalg.norm(points - reference.landmark_positions()["gn"] - [0, 40, -35], axis=1) < 32
    spot = np.linalg.norm(points - points[np.argmin(points[:, 2])], axis=1) < 24
    for some, least in ((tattoo, 500), (spot, 100)):
        inside = some[target.triangles].all(axis=1)
        assert target.area[inside].sum() > least and not dressed(CLOTHS["navy"], some)[0].any()
    scan = dressed(CLOTHS["navy"], shirt)[2]
    assert not dressed(SKIN, none, replace(scan, colour=None))[0].any()
    blank = replace(scan, colour=np.where(shirt[:, None], 1.0, scan.colour))
    assert not dressed(SKIN, none, blank)[0].any()
    bluish = SKIN * np.exp(np.tanh(points[:, :1] / 40) * [0, 0, 0.5])  # light of two colours
    assert not dressed(SKIN, none, replace(scan, colour=np.clip(bluish, 0, 0.99)))[0].any()
    face = reference.landmark_positions()["sn"]
    unlike = replace(scan, colour=np.where((np.linalg.norm(points - face, axis=1) < 90)[:, None], scan.colour, 1.0))
    assert not dressed(SKIN, none, unlike)[0].any()  # a face without a neck
    on_nose = np.linalg.norm(points - reference.landmark_positions()["prn"], axis=1) < 10
    colour = np.where(on_nose[:, None], CLOTHS["navy"], np.where(points[:, 2:] < face[2] - 60, SKIN, 1.0))
    assert 3 < on_nose.sum() < 50
    assert not dressed(SKIN, none, replace(scan, colour=colour))[0].any()  # too little of the face


def test_a_painted_face_is_no_clothing(reference, seen_skin, dressed):
    """Below the nose all is blue: what of that is chin and cheeks stays."""
    target, marks = seen_skin()
    out = dressed(CLOTHS["navy"], target.vertices[:, 2] < marks["sn"][2])[0]
    top = target.vertices[target.triangles][:, :, 2].max(axis=1)
    assert (
        out.any()
        and top[out & (target.vertices[target.triangles][:, :, 1].min(axis=1) < 0)].max() < marks["gn"][2] + 16
    )


@pytest.mark.parametrize("closed", [True, False])
def test_scans_may_be_closed_below_or_go_on_below_what_is_worn(reference, seen_skin, laid, closed):
    space, (target, _) = shape_space(reference), seen_skin()
    points, triangles = target.vertices, target.triangles
    shirt = _shirt(reference, points)
    if closed:
        rim = target._open[shirt[target._open].all(axis=1)]
        points = np.concatenate([points, [points[rim].mean(axis=(0, 1))]])
        cap = np.column_stack([rim[:, ::-1], np.full(len(rim), len(points) - 1)])
        triangles, shirt = np.concatenate([triangles, cap]), np.append(shirt, True)
    else:  # as where a chest is bare
        lower = points[np.argmin(points[:, 2])] - [[0, 0, 40], [9, 0, 40], [0, 9, 40]]
        points, shirt = np.concatenate([points, lower]), np.append(shirt, [False] * 3)
        triangles = np.concatenate([triangles, [len(points) - np.array([3, 2, 1])]])
    scan = Mesh.from_triangles(points, triangles, colour=np.where(shirt[:, None], CLOTHS["navy"], SKIN))
    cut = Surface(points, triangles, 2.0)
    out = clothing_over(space, laid(space, reference.skin.vertices[space.vertices]), cut, scan)
    cloth = shirt[cKDTree(points).query(cut.vertices)[1]][cut.triangles].all(axis=1)
    low = cut.vertices[cut.triangles[cloth]][:, :, 2].min() - cut.vertices[:, 2].min()
    if closed:
        assert low < 1 and not cut.border_vertex[np.unique(cut.triangles[cloth])].any()
    else:
        assert low > 21
    assert cloth.sum() > 5 and out[cloth].all() and not out.all()


def test_what_a_shirt_cuts_off_goes_with_it(reference, seen_skin, dressed):
    """A print in the colour of skin."""
    points = seen_skin()[0].vertices
    shirt = _shirt(reference, points)
    inside = cKDTree(points[~shirt]).query(points)[0]
    print_ = np.linalg.norm(points - points[np.argmax(inside)], axis=1) < 0.6 * inside.max()
    out, target, _ = dressed(CLOTHS["navy"], shirt & ~print_)
    printed = print_[target.triangles].all(axis=1)
    assert printed.sum() > 10 and out[printed].all()


def test_a_first_look_leaves_it_out_unless_told_not_to(reference, seen_skin, dressed):
    target, marks = seen_skin()
    shirt = _shirt(reference, target.vertices)
    _, _, scan = dressed(CLOTHS["navy"], shirt)
    look = finish(first_look(reference, target, marks, scan=scan))
    all_of_it = float(target.area[shirt[target.triangles].all(axis=1)].sum())
    assert all_of_it < look.left_out["clothing"] < 1.4 * all_of_it
    assert sum(look.left_out.values()) == look.left_out["clothing"]
    assert not _shirt(reference, look.target.vertices).any()
    neck = reference.groups["neck"] > 0.5
    assert neck[look.clothed].mean() > 0.9 and len(look.clothed) > 200
    kept = finish(first_look(reference, target, marks, set(NO_SKIN) - {"clothing"}, scan=scan))
    assert kept.left_out["clothing"] == 0 and len(kept.clothed) == 0
    assert len(kept.target.triangles) == len(target.triangles)


def test_a_thick_collar_does_not_shape_the_neck(reference, seen_skin, dressed):
    """The neck below is nearer to the skin than to the collar, which stands off it by 8 mm; colours do not come from it."""
    target, marks = seen_skin()
    shirt = _shirt(reference, target.vertices)
    _, _, scan = dressed(CLOTHS["red"], shirt)
    thick = target.vertices + 8 * shirt[:, None] * vertex_normals(target.vertices, target.triangles)
    scan = replace(scan, vertices=thick)
    built = {choice: finish(build_head(reference, scan, marks, 0, leave_out=choice)) for choice in ("auto", "never")}
    clothed = built["auto"].attributes["clothed"]
    assert clothed.sum() > 200 and not built["never"].attributes["clothed"].any()
    assert not built["auto"].attributes["fitted"][clothed].any()
    assert "clothing" in built["auto"].fit["sentence"] and "neck" in built["auto"].fit["invented"]
    off = {
        choice: Surface(reference.skin.vertices, reference.skin.triangles)
        .closest(each.head.skin.vertices[clothed])
        .distance
        for choice, each in built.items()
    }
    assert np.median(off["auto"]) < 3 < 6 < np.median(off["never"])


def test_the_collar_of_a_photographed_man_does_not_stay(shared, reference):
    from headshop.headshop_addon.scan_import import read_scan

    path = shared / "scans" / "menpo_james.ply"
    scan = clean_scan(read_scan(path))[0]
    marks = read_landmarks(path.with_suffix(".landmarks.json"))
    look = finish(first_look(reference, Surface(scan.vertices, scan.triangles, 2.0), marks, scan=scan))
    assert 6800 < look.left_out["clothing"] < 8500  # with what its edge shades
    throats = []
    for vertices, triangles in ((scan.vertices, scan.triangles), (look.target.vertices, look.target.triangles)):
        middle = vertices[triangles].mean(axis=1)
        throats.append((np.linalg.norm(middle - marks["gn"] - [0, 40, -30], axis=1) < 20).sum())
    assert throats[0] == throats[1] > 10
