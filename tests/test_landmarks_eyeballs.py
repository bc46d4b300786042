# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyeballs that a scan shows, and the margins of the lids around them."""

import numpy as np
import pytest

from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.shut_eyes import with_shut_eyes
from headshop.sim.landmarks.expression import fit_expression
from headshop.sim.landmarks.eyeballs_seen import ACROSS, ASIDE, STEP, margins, margins_seen, sphere_in
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.progress import finish

X, Y = np.arange(-ASIDE, ASIDE + STEP / 2, STEP), np.arange(ACROSS, -ACROSS - STEP / 2, -STEP)


def drain(work):
    """What the generator ``work`` returns."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            return end.value


def with_eyeballs(reference, sides=()):
    """The skin as a scanner sees it that sees the eyeballs too, those on ``sides`` behind shut lids, and its landmarks."""
    head = with_shut_eyes(reference, sides)
    seen = (head.groups["inner"] < 0.5)[head.skin.triangles].all(axis=1)
    points, triangles = [drawn(head.skin.faces, head.skin.vertices)], [head.skin.triangles[seen]]
    for eye in ("eye_l", "eye_r"):
        ball = reference.parts[eye]
        triangles.append(ball.triangles + sum(map(len, points)))
        points.append(drawn(ball.faces, ball.vertices))
    return Surface(np.concatenate(points), np.concatenate(triangles), smooth=2.0), head.landmark_positions()


def eye(radius=10.0, upper=4.0, lower=-3.0, noise=0.0):
    """Depth (r, c) mm of lids some 1 mm before a sphere that is seen between heights ``upper`` and ``lower``."""
    across, up = np.meshgrid(X, Y)
    ball = 12 - np.sqrt(np.maximum(radius**2 - (across - 1) ** 2 - up**2, 0))
    opening = (1 - (across / 11) ** 2).clip(0)
    lids = 1.2 + 0.02 * (across**2 + up**2)
    depth = np.where((up < upper * opening) & (up > lower * opening), ball, lids)
    return depth + noise * np.random.default_rng(0).standard_normal(depth.shape)


def test_a_sphere_is_found_with_its_middle_and_radius():
    ball = sphere_in(X, Y, eye(noise=0.02))
    assert ball.is_eyeball and ball.radius == pytest.approx(10, abs=0.3)
    np.testing.assert_allclose(ball.middle, [1, 0, -12], atol=0.4)
    places = {name: Y[row] for name, row, _ in margins(X, Y, eye(noise=0.02), ball)}
    assert places["ps"] == pytest.approx(4.0 + 0.8, abs=0.9) and places["pi"] == pytest.approx(-3.0 - 0.6, abs=0.9)


@pytest.mark.parametrize(
    "depth",
    [
        np.full((len(Y), len(X)), np.nan),
        np.zeros((len(Y), len(X))),
        0.02 * (X**2 + Y[:, None] ** 2),  # the lids of a shut eye, and brows and cheeks, are flatter
        eye(noise=0.5),
    ],
)
def test_nothing_else_is_an_eyeball(depth):
    ball = sphere_in(X, Y, depth)
    assert ball is None or not ball.is_eyeball


def test_a_hole_beside_an_eyeball_does_no_harm():
    depth = eye(noise=0.02)
    depth[:, X > 6] = np.nan
    assert sphere_in(X, Y, depth).is_eyeball


@pytest.mark.parametrize("turned", [False, True])
def test_margins_of_lids_are_where_eyeballs_end(reference, turned):
    target, marks = with_eyeballs(reference)
    turn = np.eye(3)
    if turned:
        turn = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))[0]
        turn *= 0.8 * np.sign(np.linalg.det(turn))
    there = {name: turn @ place for name, place in marks.items()}
    found = margins_seen(there, turn, Surface(target.vertices @ turn.T, target.triangles))
    assert set(found) == {"ps_l", "pi_l", "ps_r", "pi_r"}
    back = np.linalg.inv(turn)
    for name, place in found.items():
        assert abs((back @ place)[2] - marks[name][2]) < 1.6


def test_an_eye_that_is_lost_is_the_other_ones_mirror_image(reference):
    target, marks = with_eyeballs(reference)
    middle = target.vertices[target.triangles].mean(axis=1)
    lost = np.linalg.norm(middle - (marks["en_r"] + marks["ex_r"]) / 2, axis=1) < 14
    found = margins_seen(marks, np.eye(3), target.without(lost))
    for name in ("ps_r", "pi_r"):
        np.testing.assert_allclose(found[name], found[f"{name[:2]}_l"] * [-1, 1, 1], atol=0.5)


def test_noise_hides_no_two_eyeballs(reference):
    target, marks = with_eyeballs(reference)
    noise = 0.2 * np.random.default_rng(1).standard_normal(target.vertices.shape)
    found = margins_seen(marks, np.eye(3), Surface(target.vertices + noise, target.triangles, smooth=2.0))
    assert all(abs(place - marks[name])[2] < 2.0 for name, place in found.items()) and len(found) == 4


def test_behind_shut_lids_no_eyeball_is_seen(reference):
    target, marks = with_eyeballs(reference, ("l", "r"))
    assert margins_seen(marks, np.eye(3), target) == {}


def test_a_skin_is_not_laid_on_eyeballs(reference):
    """Eyes half shut: their lids are found where they are, and not above the eyeballs."""
    target, marks = with_eyeballs(reference)
    space = shape_space(reference)
    fit = drain(fit_shape(space, target, Pose(1.0, np.eye(3), np.zeros(3), 0.0)))
    fit, shown = drain(fit_expression(space, target, fit))
    assert shown.shut == () and set(shown.lids) == {"ps_l", "pi_l", "ps_r", "pi_r"}
    laid = space.landmarks(fit.points)
    for name in shown.lids:
        assert abs(laid[name] - marks[name])[2] < 2.5


def test_lids_around_eyeballs_are_told_where_none_are_given(reference):
    target, marks = with_eyeballs(reference)
    twelve = ("n", "prn", "sn", "en_l", "en_r", "ex_l", "ex_r", "ch_l", "ch_r", "gn", "t_l", "t_r")
    told = finish(first_look(reference, target, {name: marks[name] for name in (*twelve, "pi_r")})).landmarks
    assert set(told) == {*twelve, "pi_r", "ps_l", "pi_l"}  # one lid of the right eye was given: the artist knows
    assert all(abs(told[name] - marks[name])[2] < 1.6 for name in ("ps_l", "pi_l"))
