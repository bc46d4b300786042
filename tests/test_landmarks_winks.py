# SPDX-License-Identifier: GPL-3.0-or-later
"""Winks: one eye is found shut and the other open, and eyes that are alike are not taken for a wink."""

from dataclasses import replace

import numpy as np
import pytest

from headshop.sim.adapt.lid_line import LidLine
from headshop.sim.landmarks import expression
from headshop.sim.landmarks.expression import fit_expression, shut_share
from headshop.sim.landmarks.eye_gaps import EyeGaps
from headshop.sim.landmarks.lid_creases import lid_lines
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.landmarks.winks import winking
from headshop.sim.progress import finish

HERE = Pose(1.0, np.eye(3), np.zeros(3), 0.0)
OPEN, SHUT = EyeGaps(0.9, 0.1), EyeGaps(0.1, 0.6)


def line(depth, second):
    """A line of no particular places."""
    return LidLine(np.zeros((45, 3)), depth, second)


TWO, ONE = line(1.2, 1.1), line(1.1, 0.2)


@pytest.mark.parametrize("side", ["l", "r"])
def test_an_eye_that_neither_gapes_nor_has_a_second_crease_winks(side):
    other = "r" if side == "l" else "l"
    assert winking({side: SHUT, other: OPEN}, {side: ONE, other: TWO}) == side


def test_eyes_that_differ_in_one_thing_only_are_alike():
    assert winking({"l": SHUT, "r": OPEN}, {"l": TWO, "r": TWO}) is None  # a scanner saw more of one eyeball
    assert winking({"l": OPEN, "r": OPEN}, {"l": ONE, "r": TWO}) is None  # noise beside one lid
    assert winking({"l": SHUT, "r": SHUT}, {"l": ONE, "r": TWO}) is None
    assert winking({"l": SHUT, "r": OPEN}, {"l": TWO, "r": ONE}) is None  # that one gapes and another is creased


def test_an_eye_without_a_plain_crease_does_not_wink():
    """A hole that a program has filled smoothly lies over an open eye."""
    assert winking({"l": SHUT, "r": OPEN}, {"l": line(0.3, 0.05), "r": TWO}) is None


@pytest.mark.parametrize("side", ["l", "r"])
def test_of_a_wink_one_eye_is_fitted_shut_and_the_other_open(reference, seen_skin, side):
    target, marks = seen_skin((side,))
    other = "r" if side == "l" else "l"
    space = shape_space(reference)
    fit, shown = finish(fit_expression(space, target, finish(fit_shape(space, target, HERE))))
    assert shown.shut == (side,) and set(shown.lids) == {f"ps_{other}", f"pi_{other}"}
    share = shut_share(space, fit)
    assert share[side] == pytest.approx(1.0, abs=0.25) and abs(share[other]) < 0.25
    laid = space.landmarks(fit.points)
    for name in ("ps", "pi"):
        for which in "lr":
            assert abs(laid[f"{name}_{which}"] - marks[f"{name}_{which}"])[2] < 1.5


def test_lids_of_a_wink_go_where_either_eye_shows_them(reference, seen_skin, monkeypatch):
    """To the crease of the shut eye, and to the margins of the open one."""
    target, _ = seen_skin(("l",))
    space = shape_space(reference)
    first = finish(fit_shape(space, target, HERE))
    lines, places = lid_lines(space, first, target), {}
    for up in (0.0, 4.0):
        moved = {side: replace(line, places=line.places + [0, 0, up]) for side, line in lines.items()}
        monkeypatch.setattr(expression, "lid_lines", lambda *_, moved=moved: moved)
        seen = {name: space.landmarks(first.points)[name] + [0, 0, up] for name in ("ps_r", "pi_r")}
        monkeypatch.setattr(expression, "open_lids", lambda *_, seen=seen: seen)
        places[up] = space.landmarks(finish(fit_expression(space, target, first))[0].points)
    for name in ("ps_l", "ps_r"):
        assert (places[4.0][name] - places[0.0][name])[2] > 1.0


def test_a_wink_is_fitted_where_the_open_eye_shows_no_margins(reference, seen_skin, monkeypatch):
    """Joining what nothing tells of one eye with what a crease tells of the other ended in a traceback."""
    target, _ = seen_skin(("l",))
    monkeypatch.setattr(expression, "open_lids", lambda *_: {})
    space = shape_space(reference)
    fit, shown = finish(fit_expression(space, target, finish(fit_shape(space, target, HERE))))
    assert shown.shut == ("l",) and shown.lids == {}
    assert shut_share(space, fit)["l"] == pytest.approx(1.0, abs=0.25)


def test_half_a_face_does_not_wink(reference, seen_skin, monkeypatch):
    """The eye that is not seen is as the other one."""
    target, _ = seen_skin(("r",))
    half = target.without(target.vertices[target.triangles][:, :, 0].max(axis=1) > 6.0)
    monkeypatch.setattr(expression, "winking", lambda *_: pytest.fail("asked of one eye"))
    space = shape_space(reference)
    _, shown = finish(fit_expression(space, half, finish(fit_shape(space, half, HERE))))
    assert set(shown.shut) == {"l", "r"}
