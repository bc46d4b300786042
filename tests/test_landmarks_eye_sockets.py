# SPDX-License-Identifier: GPL-3.0-or-later
"""Empty sockets of made heads: eyes are open, and the openings tell where their corners are, however wrong the guess."""

import numpy as np
import pytest

from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.lid_line import LidLine
from headshop.sim.landmarks import expression
from headshop.sim.landmarks.expression import shut_by_sight
from headshop.sim.landmarks.eye_gaps import EyeGaps, gaps_in_eyes
from headshop.sim.landmarks.eye_sockets import ACROSS, ASIDE, STEP, opening_in, socket_corners
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.landmarks.lid_creases import shut_by_creases
from headshop.sim.landmarks.open_lids import open_lids
from headshop.sim.landmarks.picked import moved
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import CHANGE, fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.progress import finish

X, Y = np.meshgrid(np.arange(-ASIDE, ASIDE + STEP / 2, STEP), np.arange(ACROSS, -ACROSS - STEP / 2, -STEP))
BOTH = ("l", "r")
EYES = [f"{name}_{side}" for name in ("en", "ex", "ps", "pi") for side in BOTH]
CORNERS = [name for name in EYES if name[0] == "e"]


@pytest.fixture
def sockets(seen_skin):
    """``sockets(shut)`` -> the skin as a scanner sees it with a wall behind the holes of its eyes, and its landmarks."""

    def make(shut=(), depth=25.0):
        target, marks = seen_skin(shut)
        middle = np.mean([marks[name] for name in CORNERS], axis=0)
        wall = middle + np.array([[-48, depth, -16], [48, depth, -16], [48, depth, 16], [-48, depth, 16]])
        return target.beside(wall, np.array([[0, 1, 2], [0, 2, 3]])), marks

    return make


def shifted(marks, by):
    """``marks`` with those of the eyes moved ``by`` (3,) mm."""
    return marks | {name: marks[name] + by for name in EYES}


@pytest.mark.parametrize("by", [(0, 0, 0), (0, 4, -7), (2, -3, 6)])
def test_corners_are_at_the_ends_of_an_opening_wherever_they_are_looked_for(sockets, by):
    target, marks = sockets()
    found = socket_corners(shifted(marks, by), np.eye(3), target)
    assert sorted(found) == sorted(CORNERS)
    assert max(np.linalg.norm(found[name] - marks[name] - moved(name)) for name in CORNERS) < 2.5


def test_corners_are_found_whatever_the_turn_and_size(sockets):
    target, marks = sockets()
    turn = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))[0]
    turn *= 0.8 * np.sign(np.linalg.det(turn))
    there = {name: turn @ place for name, place in marks.items()}
    found = socket_corners(there, turn, Surface(target.vertices @ turn.T, target.triangles))
    assert max(np.linalg.norm(found[name] - there[name] - turn @ moved(name)) for name in CORNERS) < 1.5


def test_there_are_none_in_shut_eyes_holes_or_eyeballs(sockets, seen_skin):
    target, marks = sockets(BOTH)
    assert socket_corners(marks, np.eye(3), target) == {}
    for seen in (seen_skin(), seen_skin((), ("eye_l", "eye_r"))):
        assert socket_corners(seen[1], np.eye(3), seen[0]) == {}
    target, marks = sockets(("l",))  # one socket alone is a hole
    assert socket_corners(marks, np.eye(3), target) == {}
    target, marks = sockets(depth=80.0)  # and through a hole the back of the head's shell is seen
    assert socket_corners(marks, np.eye(3), target) == {}


def test_sockets_of_a_head_are_alike(sockets):
    target, marks = sockets()
    x, y, z = marks["ex_l"] + [-8.5, -9.0, 0.0]
    lid = np.array(
        [[x, y, z - 14], [x + 18, y, z - 14], [x + 18, y, z + 14], [x, y, z + 14]]
    )  # over a third of one of them
    covered = target.beside(lid, np.array([[0, 1, 2], [0, 2, 3]]))
    assert socket_corners(marks, np.eye(3), covered) == {}


def eye(width=28.0, height=9.0, bottom=25.0, hole=0.0):
    """Depth (r, c) mm of skin that is open over ``width`` by ``height``, the middle ``hole`` mm of which has no bottom."""
    depth = -5.0 + 0.004 * X**2
    inside = (2 * X / width) ** 2 + (2 * Y / height) ** 2 < 1
    depth[inside] = bottom
    depth[inside & (np.abs(X) < hole / 2)] = np.nan
    depth[X > 22] = 30.0  # the temple
    return depth


def test_an_opening_is_told_from_holes_and_temples_by_size_and_bottom():
    found = opening_in(eye())
    assert np.ptp(np.flatnonzero(found.any(axis=0))) * STEP == pytest.approx(28, abs=1)
    assert np.ptp(np.flatnonzero(found.any(axis=1))) * STEP == pytest.approx(9, abs=1)
    assert np.array_equal(opening_in(eye(hole=14.0)), found)
    for none in (eye(bottom=4.0), eye(width=12.0), eye(height=2.0), eye(height=30.0), eye(hole=26.0)):
        assert opening_in(none) is None
    assert opening_in(np.full(X.shape, np.nan)) is None


def test_eyes_that_are_looked_for_below_their_sockets_are_open_all_the_same(sockets):
    target, marks = sockets()
    for down in (0.0, 5.0, 8.0):
        assert gaps_in_eyes(shifted(marks, (0, 0, -down)), np.eye(3), target).show_open


def test_margins_of_lids_are_seen_by_a_skin_that_was_drawn_into_the_sockets(sockets):
    target, marks = sockets()
    seen = open_lids(shifted(marks, (0, 7.5, 0)), np.eye(3), target)
    assert sorted(seen) == sorted(set(EYES) - set(CORNERS))
    assert max(np.linalg.norm(seen[name] - marks[name]) for name in seen) < 5


def test_a_fit_comes_to_the_corners_that_sockets_tell(reference, sockets, monkeypatch):
    target, _ = sockets()
    space = shape_space(reference)
    fit = finish(fit_shape(space, target, Pose(1.0, np.eye(3), np.zeros(3), 0.0), CHANGE))
    places, off = {}, np.array([0, 0, 4.0])
    told = socket_corners(space.landmarks(fit.points), fit.matrix, target)
    for up in (0.0, 1.0):
        corners = {name: place + up * off for name, place in told.items()}
        monkeypatch.setattr(expression, "socket_corners", lambda *_, corners=corners: corners)
        fitted, shown = finish(expression.fit_expression(space, target, fit))
        assert {name: shown.lids[name] for name in CORNERS} == corners and not shown.shut
        places[up] = space.landmarks(fitted.points)
    assert min((places[1.0][name] - places[0.0][name])[2] for name in CORNERS) > 1.0


def test_corners_that_are_given_stay_and_others_are_told(reference, sockets):
    target, marks = sockets()
    given = {name: marks[name] for name in ("n", "prn", "sn", "ch_l", "ch_r", "gn", "t_l", "t_r")}
    given |= {"en_l": marks["en_l"] + [1.0, 0, 1.0]}
    told = finish(first_look(reference, target, given)).landmarks
    assert set(told) == {*given, *EYES}
    np.testing.assert_array_equal(told["en_l"], given["en_l"])


@pytest.mark.parametrize(("second", "shut"), [(0.0, True), (0.3, None), (0.9, False)])
def test_lids_that_fit_wide_open_are_shut_if_there_is_no_second_crease_at_all(second, shut):
    lines = dict.fromkeys("lr", LidLine(np.zeros((45, 3)), 1.2, second))
    assert shut_by_sight(EyeGaps(0.0, 0.0), lines, dict.fromkeys("lr", -0.4)) is shut
    assert shut_by_sight(EyeGaps(0.0, 0.0), lines, dict.fromkeys("lr", 0.1)) is bool(shut or shut is None)


def test_a_deep_fold_above_them_leaves_lids_shut():
    for second, shut in ((0.47, True), (0.58, False)):  # of 1.2 mm: a head with deep folds, and the least of open eyes
        assert shut_by_creases(dict.fromkeys("lr", LidLine(np.zeros((45, 3)), 1.2, second))) is shut
