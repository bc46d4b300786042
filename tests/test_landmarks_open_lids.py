# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyeballs that a scan shows, and the margins of open lids, around eyeballs and around holes."""

from dataclasses import replace

import numpy as np
import pytest

from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.eye_frame import eye_frame
from headshop.sim.landmarks import find
from headshop.sim.landmarks import open_lids as open_lids_module
from headshop.sim.landmarks.expression import fit_expression
from headshop.sim.landmarks.eyeballs_seen import ACROSS, ASIDE, STEP, Eyeball, eyeballs_seen, sphere_in
from headshop.sim.landmarks.first_look import first_look
from headshop.sim.landmarks.open_lids import ARCHES, SHARES, arches, best_pair, bow, open_lids
from headshop.sim.landmarks.open_lids import BOTTOM as LOWEST
from headshop.sim.landmarks.open_lids import STEP as FINE
from headshop.sim.landmarks.open_lids import TOP as HIGHEST
from headshop.sim.landmarks.pose_search import Pose
from headshop.sim.landmarks.shape_fit import fit_shape
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.mesh import Mesh
from headshop.sim.progress import finish

X, Y = np.arange(-ASIDE, ASIDE + STEP / 2, STEP), np.arange(ACROSS, -ACROSS - STEP / 2, -STEP)
EYEBALLS = ("eye_l", "eye_r")
LIDS = ("ps_l", "pi_l", "ps_r", "pi_r")


def turned(target, marks, turn):
    """The same turned and scaled by ``turn`` (3, 3)."""
    return Surface(target.vertices @ turn.T, target.triangles), {name: turn @ place for name, place in marks.items()}


def any_turn(size):
    """A rotation times ``size``."""
    turn = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))[0]
    return size * np.sign(np.linalg.det(turn)) * turn


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


@pytest.mark.parametrize(
    "depth",
    [
        np.full((len(Y), len(X)), np.nan),
        np.zeros((len(Y), len(X))),
        0.02 * (X**2 + Y[:, None] ** 2),  # the lids of a shut eye, and brows and cheeks, are flatter
        eye(noise=0.7),
    ],
)
def test_nothing_else_is_an_eyeball(depth):
    ball = sphere_in(X, Y, depth)
    assert ball is None or not ball.is_eyeball


def test_a_hole_beside_an_eyeball_does_no_harm():
    depth = eye(noise=0.02)
    depth[:, X > 6] = np.nan
    assert sphere_in(X, Y, depth).is_eyeball


def test_two_that_are_alike_may_be_noisy():
    one, other = (sphere_in(X, Y, eye(upper=upper, noise=0.4)) for upper in (4.0, 4.6))
    assert not one.is_eyeball and one.is_like(other)
    assert not one.is_like(sphere_in(X, Y, eye(radius=13.0, noise=0.4)))


def test_eyeballs_are_seen_between_open_lids_only(reference, seen_skin):
    target, marks = seen_skin((), EYEBALLS)
    assert set(eyeballs_seen(marks, np.eye(3), target)) == {"l", "r"}
    turn = any_turn(0.8)
    there = turned(target, marks, turn)
    for side, ball in eyeballs_seen(there[1], turn, there[0]).items():
        eye = reference.parts[f"eye_{side}"].vertices @ turn.T
        front = eye[(eye @ -turn[:, 1]).argmax()]
        assert ball.shows(front) and not ball.shows(there[1][f"ps_{side}"] - 3 * turn[:, 1])
    target, marks = seen_skin(("l", "r"), EYEBALLS)
    assert not eyeballs_seen(marks, np.eye(3), target)


@pytest.mark.parametrize("eyeballs", [EYEBALLS, EYEBALLS[:1], ()])
@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_margins_of_open_lids_are_seen_around_eyeballs_and_holes(seen_skin, eyeballs, noise):
    target, marks = seen_skin((), eyeballs)
    rough = target.vertices + noise * np.random.default_rng(1).standard_normal(target.vertices.shape)
    turn = any_turn(1.2)
    target, there = turned(Surface(rough, target.triangles), marks, turn)
    seen = open_lids(there, turn, target, eyeballs_seen(there, turn, target))
    assert set(seen) == set(LIDS)
    for name, place in seen.items():
        assert abs((np.linalg.solve(turn, place) - marks[name])[2]) < 1.8


def test_holes_in_brows_are_no_margins(seen_skin):
    target, marks = seen_skin()
    middle = target.vertices[target.triangles].mean(axis=1)
    brow = (marks["ps_l"] + [0, 0, 9.0], marks["ps_r"] + [6, 0, 12.0])
    lost = np.min([np.linalg.norm((middle - place)[:, [0, 2]], axis=1) for place in brow], axis=0) < 4
    seen = open_lids(marks, np.eye(3), target.without(lost & (middle[:, 1] < 0)))
    assert all(abs(place - marks[name])[2] < 1.8 for name, place in seen.items()) and len(seen) == 4


def test_the_plainest_arches_lie_along_what_is_lacking():
    heights = np.arange(HIGHEST, LOWEST - FINE / 2, -FINE)
    curve = bow()
    worth = ((heights < 6 * curve[:, None]) & (heights > -3 * curve[:, None])).astype(float)
    upper, lower = arches(worth)
    assert ARCHES[upper.argmax()] == pytest.approx(6, abs=0.3) and ARCHES[lower.argmax()] == pytest.approx(-3, abs=0.3)
    assert best_pair(2 * upper, 2 * lower) == pytest.approx((6, -3), abs=0.3)
    assert curve.max() == pytest.approx(1) and len(SHARES) == len(curve)


def test_of_arches_as_plain_those_are_taken_that_are_as_far_apart_as_lids():
    upper, lower = (np.isin(ARCHES, heights).astype(float) for heights in ([5.0], [-8.0, -4.0]))
    assert best_pair(upper, lower) == (5.0, -4.0)


def flush_eyes(marks, upper=5.0, lower=-3.5):
    """Lids that rise gently from an eyeball, which is seen between arches of those heights, on both sides; and the eyeballs."""
    shares, heights = np.linspace(-0.1, 1.1, 90), np.linspace(14, -12, 130)
    target, eyeballs = None, {}
    for side in "lr":
        frame = eye_frame(marks, side, np.eye(3))
        places = frame.lines(shares, heights)
        eyeballs[side] = Eyeball(frame.inner + frame.way / 2 - 10 * frame.forward, 16.0)
        curve = (4 * shares * (1 - shares))[:, None]
        beyond = np.maximum(np.maximum(heights - upper * curve, lower * curve - heights), 0)
        within = places + (np.clip(heights, lower * curve, upper * curve) - heights)[..., None] * frame.up
        aside = within - eyeballs[side].middle
        aside -= (aside @ frame.forward)[..., None] * frame.forward
        out = np.sqrt(np.maximum(16.0**2 - (aside**2).sum(axis=2), 0)) + 0.35 * np.minimum(beyond, 5)
        points = places + (out - (places - eyeballs[side].middle) @ frame.forward)[..., None] * frame.forward
        points = points.reshape(-1, 3)
        corner = np.arange(len(points)).reshape(len(shares), -1)
        a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
        triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
        target = Surface(points, triangles) if target is None else target.beside(points, triangles)
    return target, eyeballs


def test_an_eyeball_makes_margins_plainer(reference, monkeypatch):
    marks = reference.landmark_positions()
    target, eyeballs = flush_eyes(marks)
    plain = []

    def pair(upper, lower):
        plain.append((upper[:, None] + lower).max())
        return best_pair(upper, lower)

    monkeypatch.setattr(open_lids_module, "best_pair", pair)
    open_lids(marks, np.eye(3), target)
    seen = open_lids(marks, np.eye(3), target, eyeballs)
    assert plain[1] > plain[0] + 1
    for name, place in seen.items():
        frame = eye_frame(marks, name[-1], np.eye(3))
        share = frame.share(place)
        height = (place - frame.inner - share * frame.way) @ frame.up
        assert height == pytest.approx(4 * share * (1 - share) * {"ps": 5.0, "pi": -3.5}[name[:2]], abs=2)


def test_landmarks_of_lids_are_where_these_are_seen(reference, seen_skin, monkeypatch):
    target, _ = seen_skin((), EYEBALLS)
    seen = np.array([30.0, -90.0, 20.0])

    def told(*asked):
        fit, shown = yield from fit_expression(*asked)
        return fit, replace(shown, lids={"ps_l": seen})

    monkeypatch.setattr(find, "fit_expression", told)
    found = finish(find.find_landmarks(Mesh.from_triangles(target.vertices, target.triangles), reference))
    np.testing.assert_array_equal(found.positions["ps_l"], seen)
    assert "ps_l" not in found.mid_air


def test_smooth_skin_has_no_margins(reference):
    assert best_pair(np.zeros(len(ARCHES)), np.zeros(len(ARCHES))) is None
    marks = reference.landmark_positions()
    wall = np.array([[-90, 0, -90], [90, 0, -90], [90, 0, 90], [-90, 0, 90.0]])
    wall += np.mean([marks["en_l"], marks["en_r"]], axis=0)
    assert open_lids(marks, np.eye(3), Surface(wall, np.array([[0, 1, 2], [0, 2, 3]]))) == {}


def test_a_skin_is_not_laid_on_eyeballs(reference, seen_skin):
    target, marks = seen_skin((), EYEBALLS)
    space = shape_space(reference)
    fit = finish(fit_shape(space, target, Pose(1.0, np.eye(3), np.zeros(3), 0.0)))
    fit, shown = finish(fit_expression(space, target, fit))
    assert shown.shut == () and set(shown.lids) == set(LIDS)
    laid = space.landmarks(fit.points)
    for name in shown.lids:
        assert abs(laid[name] - marks[name])[2] < 2.5


def test_lids_around_eyeballs_are_told_where_none_are_given(reference, seen_skin):
    target, marks = seen_skin((), EYEBALLS)
    twelve = ("n", "prn", "sn", "en_l", "en_r", "ex_l", "ex_r", "ch_l", "ch_r", "gn", "t_l", "t_r")
    told = finish(first_look(reference, target, {name: marks[name] for name in (*twelve, "pi_r")})).landmarks
    assert set(told) == {*twelve, "pi_r", "ps_l", "pi_l"}  # one lid of the right eye was given: the artist knows
    assert all(abs(told[name] - marks[name])[2] < 1.8 for name in ("ps_l", "pi_l"))


@pytest.mark.parametrize("width", [1.0, 2.0])
def test_eyes_are_open_of_which_a_strip_in_the_shade_is_lost(reference, seen_skin, width):
    """It looks like the slit between shut lids, but there is an eyeball below it."""
    target, marks = seen_skin((), EYEBALLS)
    middle, lost = target.vertices[target.triangles].mean(axis=1), np.zeros(len(target.triangles), dtype=bool)
    for side in "lr":
        inner, outer, top = (marks[f"{name}_{side}"] for name in ("en", "ex", "ps"))
        share = (middle - inner) @ (outer - inner) / ((outer - inner) @ (outer - inner))
        straight = (inner + share[:, None] * (outer - inner))[:, 2]
        below = straight + (top - (inner + outer) / 2)[2] * 4 * share * (1 - share) - middle[:, 2]
        lost |= (below > 0) & (below < width) & (share > 0) & (share < 1) & (middle[:, 1] < top[1] + 15)
    space = shape_space(reference)
    fit = finish(fit_shape(space, target, Pose(1.0, np.eye(3), np.zeros(3), 0.0)))
    _, shown = finish(fit_expression(space, target.without(lost), fit))
    assert shown.shut == ()


def test_one_eye_alone_tells_as_plainly_as_two(seen_skin, monkeypatch):
    asked = []
    monkeypatch.setattr(open_lids_module, "best_pair", lambda upper, lower: asked.append((upper, lower)))
    target, marks = seen_skin()
    for sides in ("lr", "l", "r"):
        open_lids(marks, np.eye(3), target, None, sides)
    both, left, right = np.array(asked)
    np.testing.assert_allclose(both, (left + right) / 2)
    assert np.abs(left).max() > 0.5
