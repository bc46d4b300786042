# SPDX-License-Identifier: GPL-3.0-or-later
"""Beards are told from the face and left out, and chin and cheeks are invented below them."""

from dataclasses import replace

import numpy as np
import pytest

from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.scan_surface import NO_SKIN
from headshop.sim.anatomy.landmark_names import SKIN
from headshop.sim.landmarks import filled_in, find, laid_head, looks, placed_face
from headshop.sim.landmarks.beards import (
    HANGING,
    ROUGH,
    UNDER_CHIN,
    above_beard,
    beard_over,
    grows_beard,
    heights,
    lips_beside,
    rough_chin,
    thick_beard,
)
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.landmarks.picked import moved
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.landmarks.unseen_jaw import JAW
from headshop.sim.landmarks.verdict import likeness_of
from headshop.sim.mesh import Mesh
from headshop.sim.progress import finish

WORN = (3, 12, 25)


@pytest.fixture(scope="module")
def space(reference):
    return shape_space(reference)


@pytest.fixture(scope="module")
def chin(space):
    """(n,) bool: the points of the skin on which most of a beard grows."""
    return grows_beard(space) & (space.face > 0.5)


def _given(marks):
    """Landmarks that a beard does not hide."""
    hidden = ("pg", "gn", "go", "sl")
    return {n: p for n, p in marks.items() if n in SKIN and n.partition("_")[0] not in hidden}


def test_where_beards_grow(reference):
    space = shape_space(reference)
    beard, marks = grows_beard(space), space.landmarks(space.points)

    def there(place):
        return beard[np.linalg.norm(space.points - place, axis=1).argmin()]

    upper_lip = 0.5 * (marks["sn"] + marks["ls"])
    assert all(there(place) for place in (marks["pg"], marks["gn"], marks["go_l"], marks["go_r"], upper_lip))
    assert not any(there(marks[name]) for name in ("ls", "li", "ch_l", "sn", "prn", "zy_l", "t_r", "op", "g"))
    assert not beard[space.ear > 0.5].any()
    assert not beard[space.points[:, 1] > marks["t_l"][1] + 5].any()  # nor on a nape


def test_a_beard_stands_off_the_skin_and_is_rough(space, bearded, laid, chin):
    target, points, _, _ = bearded(*WORN)
    bare, _, _, _ = bearded(3, 0, 0)
    high, rough = heights(space, laid(space, points), target)
    assert 8 < np.median(high[chin]) < 20 and np.median(rough[chin]) > 0.2
    high, rough = heights(space, laid(space, points), bare)
    assert np.abs(np.median(high[chin])) < 0.1 and np.median(rough[chin]) < 0.1
    assert not high[~grows_beard(space)].any()


def test_a_beard_is_left_out_and_the_lips_are_not(space, bearded, laid, chin):
    target, points, _, _ = bearded(*WORN)
    beard = thick_beard(space, laid(space, points), target)
    over = beard_over(space, beard, target)[:, None] & np.ones(3, dtype=bool)
    left_out = np.bincount(target.triangles.ravel(), over.ravel(), len(points)) > 0
    assert left_out[chin].mean() > 0.97 and left_out[lips_beside(space)].mean() < 0.3
    assert not left_out[(space.face > 0.5) & (space.points[:, 2] > space.landmarks(space.points)["en_l"][2])].any()
    assert not beard_over(space, None, target).any()


def test_a_beard_grows_where_the_scan_stands_off_or_is_rough_and_beside_that_only(space, bearded, laid):
    target, points, _, _ = bearded(*WORN)
    zone, middle = grows_beard(space), np.abs(space.points[:, 0]) < 20
    bristly = points.copy()  # neither farther off nor nearer
    bristly[:, 1] += np.random.default_rng(4).normal(0, 3, len(points))
    for worn in (target.vertices, bristly):
        some = Surface(np.where(middle[:, None], worn, points), space.triangles)
        grows = thick_beard(space, laid(space, points), some).grows
        assert grows[zone & (np.abs(space.points[:, 0]) < 15)].mean() > 0.8
        assert not grows[~zone | (np.abs(space.points[:, 0]) > 40)].any()


def test_a_beard_on_a_head_of_another_size_is_the_same(space, bearded, laid):
    target, points, _, _ = bearded(*WORN)
    fit, small = laid(space, points), Surface(0.6 * target.vertices, target.triangles)
    child = replace(fit, points=0.6 * points, pose=replace(fit.pose, scale=0.6))
    for of_child, of_grown in zip(heights(space, child, small), heights(space, fit, target), strict=True):
        np.testing.assert_allclose(of_child, of_grown, atol=1e-6)
    own, other = (thick_beard(space, *each) for each in ((child, small), (fit, target)))
    np.testing.assert_array_equal(own.grows, other.grows)
    same = beard_over(space, own, small) == beard_over(space, other, target)
    assert same.mean() > 0.98  # the middle of a bare triangle, which lies on the skin, is as near to all of its corners


def test_what_hangs_before_the_throat_is_left_out_too(space, bearded, laid):
    target, points, _, _ = bearded(*WORN)
    throat = space.points[:, 2] < space.landmarks(space.points)["gn"][2] - UNDER_CHIN - 8  # below where beards grow
    throat &= np.abs(space.points[:, 0]) < 1
    skin = points[throat][points[throat][:, 2].argmax()]
    sheet = np.array([[-4, 0, 2], [4, 0, 2], [4, 0, -2], [-4, 0, -2]])
    off = [skin - [0, HANGING + far, 0] + sheet for far in (4, -4)]  # the second as near as a collar
    off.append(points[points[:, 2].argmin()] - [0, 20, 25] + sheet)  # below the neck's end: clothes
    faces = np.array([[0, 2, 1], [0, 3, 2]])
    longer = target.beside(np.concatenate(off), np.concatenate([faces + 4 * k for k in range(3)]))
    beard = thick_beard(space, laid(space, points), longer)
    assert beard_over(space, beard, longer)[-6:].tolist() == [True] * 2 + [False] * 4


def test_a_chin_is_invented_below_a_beard(reference, space, bearded, chin):
    target, points, marks, _ = bearded(*WORN)
    look = finish(first_look(reference, target, _given(marks), ["beard"]))
    assert look.left_out["beard"] == pytest.approx(target.area.sum() - look.target.area.sum())
    assert look.left_out["beard"] > 0.9 * target.area[chin[target.triangles].all(axis=1)].sum()
    below = look.filled.closest(points[chin]).distance
    assert np.mean(below) < 4.0 and np.percentile(below, 95) < 9.0
    assert np.mean(look.target.closest(points[chin]).distance) > 9.0
    assert np.isin(space.vertices[chin], look.hidden).mean() > 0.9


def test_landmarks_picked_on_a_chin_below_a_beard_tell_where_it_is(reference, bearded):
    target, _, marks, _ = bearded(*WORN)
    farther = {n: marks[n] + [0.0, -6.0, 0.0] for n in ("sl", "pg", "gn")}
    picks = {n: p + moved(n) for n, p in farther.items()}
    off = []
    for given, found in (({}, ()), (picks, ()), (picks, tuple(picks))):
        look = finish(first_look(reference, target, _given(marks) | given, ["beard"], found))
        off.append(look.filled.closest(farther["pg"][None]).distance[0])
    assert off[1] < 2.0 and off[0] > 2 * off[1] and off[2] == pytest.approx(off[0], abs=0.5), off


def test_landmarks_picked_on_a_beard_do_not_pull_the_chin_out_to_it(reference, space, bearded):
    """Where whoever clicks on what is to be seen has them."""
    target, points, marks, _ = bearded(*WORN)
    rows = [space.names.index(name) for name in ("sl", "pg", "gn", "go_l", "go_r")]
    seen = np.einsum("kij,ki->kj", target.vertices[space.corners[rows]], space.weights[rows])
    on = {space.names[row]: place for row, place in zip(rows, seen, strict=True)}
    assert min(np.linalg.norm(on[name] - marks[name]) for name in ("pg", "gn")) > 9
    look = finish(first_look(reference, target, _given(marks) | on, ["beard"]))
    assert not {"pg", "gn"} & set(look.landmarks) and set(_given(marks)) <= set(look.landmarks)
    for name in ("pg", "gn"):
        assert np.linalg.norm(look.guessed[name] - marks[name]) < 6 < look.filled.closest(on[name]).distance[0]


def test_below_a_beard_no_jaw_is_looked_for_that_the_scan_ends_above(reference, bearded, monkeypatch):
    """What is left of the scan ends at the mouth; that is no end of it."""
    target, _, marks, _ = bearded(*WORN)
    for at, name in ((laid_head, "with_unseen_jaw"), (filled_in, "unseen_jaw")):
        monkeypatch.setattr(at, name, lambda *_: pytest.fail("one was"))
    given = {n: p for n, p in _given(marks).items() if n not in JAW}
    assert finish(first_look(reference, target, given, ["beard"])).left_out["beard"] > 0


def test_whoever_wants_to_keep_it_does(reference, bearded):
    target, _, marks, _ = bearded(*WORN)
    look = finish(first_look(reference, target, _given(marks), set(NO_SKIN) - {"beard"}))
    assert look.left_out["beard"] == 0.0 and look.target.area.sum() > 0.95 * target.area.sum()


def test_a_bare_chin_is_no_beard(reference, bearded):
    target, _, marks, _ = bearded(3, 0, 0)
    assert finish(first_look(reference, target, marks)).left_out["beard"] == 0.0


@pytest.mark.parametrize("worn, noise, told", [((3, 0, 0), 0.6, False), (WORN, 0.0, True), (WORN, 0.2, True)])
def test_a_scan_that_is_rough_all_over_tells_nothing_of_a_beard(space, bearded, laid, worn, noise, told):
    """As the frames of depth cameras are, whose noise is as rough on chins as beards."""
    target, points, _, _ = bearded(*worn)
    strewn = noise * np.random.default_rng(1).standard_normal(target.vertices.shape)
    noisy = Surface(target.vertices + strewn, target.triangles, smooth=2.0)
    fit = laid(space, points)
    chin = grows_beard(space) & (space.face > 0.5)
    assert np.median(heights(space, fit, noisy)[1][chin]) > ROUGH  # by itself it is rough enough
    assert rough_chin(space, fit, noisy)[0] == told


def test_relief_that_a_beard_hides_says_nothing_of_a_face_above_it(reference, space, bearded, laid):
    fit = laid(space, bearded(*WORN)[0].vertices[: len(space.points)])
    assert likeness_of(reference, above_beard(space), fit) > likeness_of(reference, space, fit) + 0.05


def test_landmarks_of_a_bearded_face(reference, bearded, monkeypatch):
    monkeypatch.setattr(find, "with_unseen_jaw", lambda *_: pytest.fail("the scan was taken to end at the beard"))
    target, _, marks, _ = bearded(*WORN)
    found = finish(find_landmarks(Mesh.from_triangles(target.vertices, target.triangles), reference))
    off = {n: np.linalg.norm(p - marks[n]) for n, p in found.positions.items() if n in marks}
    assert np.mean([off[n] for n in ("ls", "sto", "li", "ch_l", "ch_r")]) < 5.0
    assert {"pg", "gn", "sl"} <= set(found.mid_air) and not {"pg", "gn", "sl"} & set(found.sure())
    assert max(off["pg"], off["gn"]) < 15.0


def test_a_face_that_nothing_but_its_upper_half_and_lips_shows_is_found(reference, space, bearded, monkeypatch):
    """As of a bald man with a large beard, whose whole face is taken for none in any other look."""
    monkeypatch.setattr(placed_face, "LOOKS", looks.LOOKS[-1:])
    monkeypatch.setattr(placed_face, "PARTS", looks.PARTS[-1:])
    target, _, marks, _ = bearded(8, 16, 30)
    mesh = Mesh.from_triangles(target.vertices, target.triangles)
    _, fit, _, of = finish(placed_face.place_face(mesh, reference, space, (1.0,)))
    assert not of.area[grows_beard(space)].any() and np.array_equal(of.area, above_beard(space).area)
    laid_on = of.landmarks(fit.points)
    assert np.mean([np.linalg.norm(laid_on[n] - marks[n]) for n in ("prn", "sn", "n", "en_l", "ex_r", "sto")]) < 4.0
    lead, asked = find.without_beards_lead, []

    def spy(reference, space, target, fit, above):
        asked.append((space.area.all(), above))
        return lead(reference, space, target, fit, above)

    monkeypatch.setattr(find, "without_beards_lead", spy)
    found = finish(find_landmarks(mesh, reference))
    assert asked == [(True, True)]  # from there on skin counts where beards grow, too
    assert {"pg", "gn"} <= set(found.mid_air)
