# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether eyes are open or shut is seen on the scan: by what it lacks there, and by the creases along the lids."""

from dataclasses import replace

import numpy as np
import pytest

from headshop.sim.adapt import skin_fit
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.lid_line import LidLine, best_way, crease, lid_line, met_at
from headshop.sim.adapt.openings import lid_margins, rims
from headshop.sim.adapt.shut_eyes import with_shut_eyes
from headshop.sim.anatomy.landmark_names import SKIN
from headshop.sim.landmarks import expression
from headshop.sim.landmarks.expression import fit_expression, shut_share
from headshop.sim.landmarks.eye_gaps import EyeGaps, crevices, eyes_shown, gaps_in_eyes
from headshop.sim.landmarks.lid_creases import lid_lines, shut_by_creases, told_of_lids
from headshop.sim.landmarks.lids_told import lids_told
from headshop.sim.landmarks.open_lids import of_both_eyes
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import CHANGE, Expression, Told, fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.progress import finish

BOTH = ("l", "r")
HERE = Pose(1.0, np.eye(3), np.zeros(3), 0.0)


def with_slit(target, marks):
    """``target`` without its triangles along the line where the lids meet, which a scanner loses."""
    middle = target.vertices[target.triangles].mean(axis=1)
    lost = np.zeros(len(middle), dtype=bool)
    for side in BOTH:
        met, inner, outer = (marks[f"ps_{side}"] + marks[f"pi_{side}"]) / 2, marks[f"en_{side}"], marks[f"ex_{side}"]
        share = (middle - inner) @ (outer - inner) / ((outer - inner) @ (outer - inner))
        sag = (met - (inner + outer) / 2)[2] * 4 * share * (1 - share)
        height = (inner + share[:, None] * (outer - inner))[:, 2] + sag
        lost |= (np.abs(middle[:, 2] - height) < 0.9) & (share > 0) & (share < 1) & (middle[:, 1] < met[1] + 15)
    return target.without(lost)


def test_an_open_eye_gapes_and_a_shut_one_does_not(seen_skin):
    for sides in ((), BOTH):
        target, marks = seen_skin(sides)
        assert gaps_in_eyes(marks, np.eye(3), target).show_open == (not sides)


def test_the_bottom_of_an_empty_socket_is_no_eye(seen_skin):
    """Made heads without eyeballs show their sockets, so no hole; the eyes are open all the same."""
    target, marks = seen_skin()
    middle = np.mean([marks[f"{name}_{side}"] for name in ("en", "ex") for side in BOTH], axis=0)
    wall = middle + np.array([[-60, 18, -25], [60, 18, -25], [60, 18, 25], [-60, 18, 25]])
    assert gaps_in_eyes(marks, np.eye(3), target.beside(wall, np.array([[0, 1, 2], [0, 2, 3]]))).show_open


def test_a_slit_along_the_lids_shows_them_shut(seen_skin):
    target, marks = seen_skin(BOTH)
    target = with_slit(target, marks)
    gaps = gaps_in_eyes(marks, np.eye(3), target)
    assert gaps.show_shut and gaps.slits > 0.5
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    turn *= 1.3 * np.sign(np.linalg.det(turn))
    there = {name: turn @ place for name, place in marks.items()}
    moved = gaps_in_eyes(there, turn, Surface(target.vertices @ turn.T, target.triangles))
    assert moved.show_shut and moved.slits == pytest.approx(gaps.slits, abs=0.1)


def test_an_opening_outweighs_slits():
    assert EyeGaps(0.4, 0.5).show_open and not EyeGaps(0.4, 0.5).show_shut
    assert not EyeGaps(0.1, 0.1).show_open and not EyeGaps(0.1, 0.1).show_shut


def test_a_crevice_is_deeper_than_both_sides():
    line = np.zeros((1, 60))
    line[0, 30] = 4.0
    line[0, 50:] = 4.0  # a step is none
    assert np.flatnonzero(crevices(line)).tolist() == [30]


def test_a_crease_is_followed_through_noise_and_holes():
    rng = np.random.default_rng(1)
    place = np.round(20 + 8 * np.sin(np.linspace(0, 3, 45))).astype(int)
    depth = 0.1 * rng.standard_normal((45, 60))
    depth[np.arange(45), place] += 1.0
    depth[10:20, 5] = 3.0  # a short, deeper one beside it
    depth[30, place[30]] = np.nan
    worth = crease(depth, 8)
    assert worth[30, place[30]] == 1.2
    assert np.abs(best_way(worth) - place).max() <= 1


def test_lids_that_meet_have_one_crease_where_they_do(seen_skin):
    target, marks = seen_skin(BOTH)
    lines = {side: lid_line(marks, side, target, np.eye(3)) for side in BOTH}
    assert shut_by_creases(lines) is True
    for side, line in lines.items():
        inner, outer = marks[f"en_{side}"], marks[f"ex_{side}"]
        met = (marks[f"ps_{side}"] + marks[f"pi_{side}"]) / 2
        share = (met - inner) @ (outer - inner) / ((outer - inner) @ (outer - inner))
        assert np.abs(line.at(share) - met)[2] < 1.0


def test_a_fold_farther_off_than_margins_are_leaves_lids_shut(reference):
    marks = reference.landmark_positions()
    middle = np.mean([marks[f"{name}_{side}"] for name in ("en", "ex") for side in BOTH], axis=0)
    x, z = np.meshgrid(np.arange(-80, 81, 4.0), np.arange(-20, 20.25, 0.25))
    n, k = x.shape[1], np.arange(x.size).reshape(x.shape)[:-1, :-1].ravel()
    triangles = np.concatenate([np.stack([k, k + 1, k + n], axis=1), np.stack([k + 1, k + n + 1, k + n], axis=1)])
    for apart, shut in ((9.0, False), (12.75, True)):
        creases = np.isin(z, np.add.outer([-4.0, apart - 4.0], [-0.25, 0, 0.25]))
        target = Surface(middle + np.stack([x, 1.2 * creases, z], axis=-1).reshape(-1, 3), triangles)
        assert shut_by_creases({side: lid_line(marks, side, target, np.eye(3)) for side in BOTH}) is shut


def test_margins_of_open_lids_have_two_creases(seen_skin):
    """Eyeballs that are scanned leave no hole between open lids."""
    target, marks = seen_skin((), ("eye_l", "eye_r"))
    assert not gaps_in_eyes(marks, np.eye(3), target).show_open
    assert shut_by_creases({side: lid_line(marks, side, target, np.eye(3)) for side in BOTH}) is False


def test_smooth_skin_tells_nothing(reference):
    marks = reference.landmark_positions()
    wall = np.array([[-90, 0, -90], [90, 0, -90], [90, 0, 90], [-90, 0, 90.0]])
    wall += np.mean([marks["en_l"], marks["en_r"]], axis=0)
    target = Surface(wall, np.array([[0, 1, 2], [0, 2, 3]]))
    assert shut_by_creases({side: lid_line(marks, side, target, np.eye(3)) for side in BOTH}) is None
    assert met_at(marks, "l", target, np.eye(3)) is None


def test_the_crease_near_the_landmarks_of_shut_lids_is_theirs(seen_skin):
    target, marks = seen_skin(BOTH)
    assert met_at(marks, "l", target, np.eye(3)) is not None
    assert met_at({n: p for n, p in marks.items() if n != "en_l"}, "l", target, np.eye(3)) is None
    away = marks | {"ps_l": marks["ps_l"] + [0, 0, 6], "pi_l": marks["pi_l"] + [0, 0, 6]}
    assert met_at(away, "l", target, np.eye(3)) is None
    middle = target.vertices[target.triangles].mean(axis=1)
    nothing = np.linalg.norm(middle - (marks["en_l"] + marks["ex_l"]) / 2, axis=1) < 18
    assert met_at(marks, "l", target.without(nothing), np.eye(3)) is None


def test_margins_of_shut_lids_rise_and_fall_with_the_crease(reference, seen_skin):
    """Where one landmark of a lid is picked 2 mm too high, the margins stay on the crease."""
    shut = with_shut_eyes(reference, BOTH)
    shut = shut.with_vertices({"skin": drawn(shut.skin.faces, shut.skin.vertices)})
    target, marks = seen_skin(BOTH)
    high = marks | {name: marks[name] + [0, 0, 2.0] for name in ("ps_l", "pi_l")}
    rim = rims(shut)
    rows, alone, _ = lid_margins(shut, rim, high, np.eye(3), BOTH)
    lines = {"l": met_at(high, "l", target, np.eye(3)), "r": None}
    again, guided, _ = lid_margins(shut, rim, high, np.eye(3), BOTH, lines)
    np.testing.assert_array_equal(rows, again)
    left = shut.skin.vertices[rows, 0] > 0
    true = shut.skin.vertices[rows]
    off = [np.sqrt(np.mean((places - true)[left, 2] ** 2)) for places in (alone, guided)]
    assert off[1] < 0.6 < off[0]
    np.testing.assert_array_equal(alone[~left], guided[~left])


def test_a_fit_to_shut_lids_lies_with_its_lids_on_the_line_and_shuts_no_farther(reference, seen_skin):
    target, marks = seen_skin(BOTH)
    target = with_slit(target, marks)
    space = shape_space(reference)
    fit = finish(fit_shape(space, target, HERE))
    fit, shown = finish(fit_expression(space, target, fit))
    assert shown.shut == BOTH
    laid = space.landmarks(fit.points)
    for side in BOTH:
        way = space.shut[side]
        assert fit.coefficients @ way / (way @ way) == pytest.approx(1.0, abs=0.25)
        for name in ("ps", "pi"):
            assert abs(laid[f"{name}_{side}"] - marks[f"{name}_{side}"])[2] < 1.5


def test_what_the_lines_tell_is_where_they_run(reference, seen_skin):
    target, _ = seen_skin(BOTH)
    space = shape_space(reference)
    fit = finish(fit_shape(space, target, HERE))
    line = lid_line(space.landmarks(fit.points), "l", target, fit.matrix)
    told = told_of_lids(space, fit, {"l": line})
    assert told.places.shape == (4, 3)
    marks, up = space.landmarks(fit.points), fit.matrix[:, 2] / np.linalg.norm(fit.matrix[:, 2])
    assert (told.places[0] - line.at(0.0)) @ up == pytest.approx(0, abs=1e-6)  # how high
    np.testing.assert_allclose(np.cross(told.places[0] - marks["en_l"], up), 0, atol=1e-6)  # and not how deep
    assert told_of_lids(space, fit, {"l": LidLine(line.places, 0.3, 0.0)}) is None


def test_shut_lids_are_shut_no_farther_than_they_meet(reference, seen_skin):
    """A line that is told far below the lids draws the skin there down, and not the lids alone beyond where they meet."""
    target, _ = seen_skin(BOTH)
    space = shape_space(reference)
    shut = Expression(False, BOTH)
    fit = finish(fit_shape(space, target, HERE, expression=shut))
    laid = space.landmarks(fit.points)
    low = Told.of(space, {name: laid[name] - [0, 0, 8.0] for name in ("ps_l", "pi_l", "ps_r", "pi_r")})
    fit = finish(fit_shape(space, target, HERE, CHANGE, fit.coefficients, expression=shut, told=low))
    assert max(shut_share(space, fit).values()) < 1.25


def test_lids_of_a_fit_go_to_the_line_where_they_are_seen_to_meet(reference, seen_skin, monkeypatch):
    target, _ = seen_skin(BOTH)
    space = shape_space(reference)
    first = finish(fit_shape(space, target, HERE))
    lines = lid_lines(space, first, target)
    places = {}
    for up in (0.0, 4.0):
        told = {side: replace(line, places=line.places + [0, 0, up]) for side, line in lines.items()}
        monkeypatch.setattr(expression, "lid_lines", lambda *_, told=told: told)
        places[up] = space.landmarks(finish(fit_expression(space, target, first))[0].points)
    assert (places[4.0]["ps_l"] - places[0.0]["ps_l"])[2] > 1.0


def test_a_skin_is_fitted_with_its_shut_lids_on_the_crease(reference, seen_skin, monkeypatch):
    target, marks = seen_skin(BOTH)
    asked = []

    def margins(*_):
        asked.append(_[-1])
        raise LookupError

    monkeypatch.setattr(skin_fit, "lid_margins", margins)
    with pytest.raises(LookupError):
        finish(skin_fit.fit_skin(reference, target, {name: marks[name] for name in SKIN}))
    assert set(asked[0]) == set(BOTH) and all(isinstance(line, LidLine) for line in asked[0].values())


def right_half(target):
    """What ``target`` shows of the right half of a face, and 6 mm beyond the middle."""
    return target.without(target.vertices[target.triangles][:, :, 0].max(axis=1) > 6.0)


@pytest.mark.parametrize("sides", [(), BOTH])
def test_of_half_a_face_the_eye_that_is_seen_tells(reference, seen_skin, sides):
    """An eye of which nothing is seen counted as a hole as large as an open one."""
    whole, marks = seen_skin(sides)
    target = right_half(with_slit(whole, marks) if sides else whole)
    laid = marks, np.eye(3), target
    assert eyes_shown(*laid) == "r" and eyes_shown(marks, np.eye(3), whole) == "lr"
    assert gaps_in_eyes(*laid).show_open
    gaps = gaps_in_eyes(*laid, "r")
    assert gaps.show_shut == bool(sides) and gaps.show_open != bool(sides)
    space = shape_space(reference)
    _, shown = finish(fit_expression(space, target, finish(fit_shape(space, target, HERE))))
    assert set(shown.shut) == set(sides)
    if not sides:
        assert {"ps_r", "pi_r"} <= set(shown.lids) and not any(name.endswith("_l") for name in shown.lids)


@pytest.mark.parametrize("share", [0.5, 0.9])
def test_an_eye_that_is_not_seen_is_as_wide_open_as_the_other(reference, seen_skin, monkeypatch, share):
    whole, marks = seen_skin(())
    target, space = right_half(whole), shape_space(reference)
    way = marks["ps_r"] - marks["pi_r"]
    narrow = {"ps_r": marks["pi_r"] + share * way, "pi_r": marks["pi_r"]}
    monkeypatch.setattr(expression, "open_lids", lambda *_: narrow)
    fit, shown = finish(fit_expression(space, target, finish(fit_shape(space, target, HERE))))
    laid = space.landmarks(fit.points)
    assert set(shown.lids) == set(narrow)
    assert np.linalg.norm(laid["ps_l"] - laid["pi_l"]) == pytest.approx(share * np.linalg.norm(way), abs=1.2)
    told = lids_told(space, fit, shown, target, {})
    assert told["ps_l"] == pytest.approx(narrow["ps_r"] * [-1, 1, 1], abs=1.5) and told["ps_r"] is narrow["ps_r"]
    assert np.linalg.norm(told["ps_l"] - told["pi_l"]) == pytest.approx(share * np.linalg.norm(way))


def test_an_eye_that_is_shut_is_not_as_the_one_that_is_open(reference, seen_skin):
    target, marks = seen_skin(("l",))
    space = shape_space(reference)
    wink = Expression(shut=("l",), lids={name: marks[name] for name in ("ps_r", "pi_r")})
    told = lids_told(space, finish(fit_shape(space, target, HERE)), wink, target, {})
    assert told["ps_l"] == pytest.approx(told["pi_l"]) and told["ps_r"] is wink.lids["ps_r"]


def test_lids_of_both_eyes_and_of_none_are_left(reference):
    marks = reference.landmark_positions()
    both = {name: marks[name] + 1 for name in ("ps_l", "pi_l", "ps_r", "pi_r")}
    assert of_both_eyes(both, marks) is both and of_both_eyes({}, marks) == {}
    one = {"ps_l": marks["ps_l"] + [0, 0, 2.0]}
    assert of_both_eyes(one, marks)["ps_r"] == pytest.approx(marks["ps_r"] + [0, 0, 2.0], abs=0.1)


def test_along_an_eye_that_is_not_seen_no_crease_is_looked_for(reference, seen_skin, monkeypatch):
    asked = []

    def lines(*rest):
        asked.append(rest[-1])
        return lid_lines(*rest)

    monkeypatch.setattr(expression, "lid_lines", lines)
    target, space = right_half(seen_skin(BOTH)[0]), shape_space(reference)
    _, shown = finish(fit_expression(space, target, finish(fit_shape(space, target, HERE))))
    assert asked == ["r"] and set(shown.shut) == set(BOTH)


def test_eyes_with_a_slit_along_the_lids_are_not_blank(reference, seen_skin, monkeypatch):
    """Of a mask with shut eyes the slits' edges, and a fold above them, were taken for margins of blank eyes."""
    target, marks = seen_skin(BOTH)
    space, told = shape_space(reference), {f"{n}_{s}": marks[f"{n}_{s}"] for n in ("ps", "pi", "ex") for s in BOTH}
    monkeypatch.setattr(expression, "blank_eyes", lambda *_: told)
    scan = with_slit(target, marks)
    _, shown = finish(fit_expression(space, scan, finish(fit_shape(space, scan, HERE))))
    assert set(shown.shut) == set(BOTH) and shown.lids == {}


def test_where_neither_eye_is_seen_both_are_looked_at(seen_skin):
    target, marks = seen_skin()
    brow = target.without(target.vertices[target.triangles][:, :, 2].min(axis=1) < marks["ps_l"][2] + 2)
    assert eyes_shown(marks, np.eye(3), brow) == "lr"
