# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces of which the scan ends at the mouth: nothing but the likeliest shape tells where the jaw is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.adapt import build
from headshop.sim.adapt.build import build_head
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.landmarks import read_landmarks
from headshop.sim.landmarks import unseen_jaw
from headshop.sim.landmarks.confidence import support
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.landmarks.looking import run
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.landmarks.unseen_jaw import PULLED_UP, below_lips, lip_to_chin, with_unseen_jaw
from headshop.sim.mesh import Mesh
from headshop.sim.progress import finish
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.individual import draw_field
from headshop.sim.scan.ply import read_ply

MOUTH = ("ls", "sto", "ch_l", "ch_r", "li")


@pytest.fixture(scope="module")
def cut_off(reference):
    """Somebody's head that ends 2 mm under the line of the lips, and the true landmarks (mm)."""
    field = draw_field(reference.landmark_positions(), np.random.default_rng(8))
    points = reference.skin.vertices + field(reference.skin.vertices)
    others = {name: part.vertices for name, part in reference.parts.items()}
    true = reference.landmarks.on(others | {"skin": points})
    return _above(reference.skin.moved(points), true["sto"][2] - 2.0), true


def _above(mesh: Mesh, height: float) -> Mesh:
    return Mesh.from_triangles(
        mesh.vertices, mesh.triangles[mesh.vertices[mesh.triangles][:, :, 2].min(axis=1) > height]
    )


def _pulled_up(space, share):
    """The skin (n, 3) mm with lower lip and chin so near to the upper lip that ``share`` of the way from ls to sl is left."""
    marks = space.landmarks(space.points)
    low = space.points[:, 2] < marks["sto"][2] - 3
    return space.points + np.outer(low, [0, 0, (1 - share) * (marks["ls"] - marks["sl"])[2]])


@pytest.mark.parametrize("name", ["somebody", "lps_infinite"])
def test_the_chin_that_a_scan_lacks_is_where_the_rest_lets_expect_it(reference, shared, cut_off, name):
    if name == "lps_infinite":
        true = read_landmarks(shared / "scans" / f"{name}.landmarks.json")
        scan = _above(clean_scan(read_ply(shared / "scans" / f"{name}.ply"))[0], true["sto"][2])
    else:
        scan, true = cut_off
    found = finish(find_landmarks(scan, reference))
    off = {n: np.linalg.norm(found.positions[n] - true[n]) for n in (*MOUTH, "sl", "pg", "gn")}
    assert max(off[n] for n in MOUTH) < 6.0
    assert max(off[n] for n in ("sl", "pg", "gn")) < 10.0
    assert {"li", "sl", "pg", "gn"} <= set(found.mid_air)


@pytest.mark.parametrize("share", [0.5, PULLED_UP - 0.03, PULLED_UP + 0.03, 1.0])
def test_a_jaw_that_is_pulled_up_is_laid_without_looking_for_it(reference, monkeypatch, share, laid):
    space = shape_space(reference)
    marks = space.landmarks(space.points)
    scan = _above(Mesh.from_triangles(space.points, space.triangles), marks["sto"][2])
    pulled = laid(space, _pulled_up(space, share))
    asked = []

    def begun_again(blind, target, fit, size):
        asked.append(blind)
        yield 1.0
        return laid(space, space.points)

    monkeypatch.setattr(unseen_jaw, "begun_again", begun_again)
    assert lip_to_chin(space, pulled) / lip_to_chin(space, laid(space, space.points)) == pytest.approx(share, abs=0.01)
    fit, left = finish(run(with_unseen_jaw(space, Surface(scan.vertices, scan.triangles), pulled), 0.0, 1.0, ""))
    low = below_lips(space)
    assert (asked[0].area[low] == 0).all() and (asked[0].area[~low] == space.area[~low]).all()
    if share < PULLED_UP:
        assert fit is not pulled and left is asked[0]
    else:
        assert fit is pulled and left is space


def test_a_chin_that_is_seen_is_looked_for(reference, monkeypatch, laid):
    space = shape_space(reference)
    monkeypatch.setattr(unseen_jaw, "begun_again", None)
    fit = laid(space, space.points)
    work = with_unseen_jaw(space, Surface(space.points, space.triangles), fit)
    assert finish(run(work, 0.0, 1.0, "")) == (fit, space)


def test_what_lies_below_the_lips(reference):
    space = shape_space(reference)
    marks = space.landmarks(space.points)
    low = below_lips(space)
    at = dict(zip(marks, cKDTree(space.points).query(list(marks.values()))[1], strict=True))
    assert low[[at[n] for n in ("li", "sl", "pg", "gn")]].all()
    assert not low[[at[n] for n in ("ls", "sn", "prn", "cph_l", "go_l", "go_r", "t_l", "sba_r")]].any()


def test_skin_that_does_not_count_is_no_support(reference, laid):
    space = shape_space(reference)
    shares = support(replace(space, area=np.where(below_lips(space), 0.0, space.area)), laid(space, space.points))
    assert shares["pg"] == 0 and shares["prn"] == 1


def test_a_lower_lip_that_is_not_seen_is_filled_in_unless_a_landmark_of_it_is_given(reference, cut_off):
    scan, true = cut_off
    target = Surface(scan.vertices, scan.triangles)
    given = {n: p for n, p in true.items() if n not in ("li", "sl", "pg", "gn", "go_l", "go_r")}
    marks = [true["li"], true["sl"], true["gn"]]
    look = finish(first_look(reference, target, given))
    lip, crease, chin = look.filled.closest(marks).distance
    assert lip < 4.0 and crease < 6.0 and chin > 8.0 and len(look.hidden) > 50
    look = finish(first_look(reference, target, given | {"pg": true["pg"]}))
    assert look.filled.closest(marks).distance.min() > 5.0


def test_a_head_whose_scan_ends_at_its_mouth_has_a_whole_mouth_and_chin(reference, cut_off, monkeypatch):
    monkeypatch.setattr(build, "smiles_closed", lambda fit: True)
    scan, true = cut_off
    given = finish(find_landmarks(scan, reference)).sure()
    built = finish(build_head(reference, scan, given, detail=0, found=set(given)))
    marks = built.head.landmark_positions()
    assert max(np.linalg.norm(marks[n] - true[n]) for n in MOUTH) < 6.0
    assert max(np.linalg.norm(marks[n] - true[n]) for n in ("sl", "pg", "gn")) < 9.0
    assert "chin" in built.fit["invented"]
    assert built.fit["advice"] is None  # of a smile, which lips tell that are not seen
    low = np.linalg.norm(built.head.skin.vertices - true["pg"], axis=1) < 10
    assert (built.attributes["fitted"][low] == 0).all()
