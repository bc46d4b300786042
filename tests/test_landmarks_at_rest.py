# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces laid on a scan that come to lie elsewhere when they are begun again: they were stuck."""

from dataclasses import replace
from itertools import accumulate
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from headshop.sim.adapt.closest import Surface
from headshop.sim.landmarks import find, placed_face
from headshop.sim.landmarks.find import find_landmarks
from headshop.sim.landmarks.placed_face import AGAIN, AT_REST, at_rest, moved
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.mesh import Mesh
from headshop.sim.progress import finish


@pytest.fixture(scope="module")
def space(reference):
    return shape_space(reference)


@pytest.fixture(scope="module")
def masked(space):
    """Somebody's face, cut off all round, noisy and turned, on which the first fit gets stuck, and its true landmarks (mm)."""
    rng = np.random.default_rng(5)
    points = space.shaped(rng.normal(0, 0.8, space.modes.shape[2]))
    marks = space.landmarks(points)
    middle = np.array([0, 40, rng.uniform(-5, 15)])
    shown = np.linalg.norm((points - marks["prn"]) * [1, 1.2, 0.85] - middle, axis=1) < rng.uniform(62, 85)
    triangles = space.triangles[shown[space.triangles].all(axis=1)]
    turn = Rotation.random(random_state=5)
    points = points + rng.normal(0, 0.3, points.shape)
    used, corners = np.unique(triangles, return_inverse=True)
    scan = Mesh.from_triangles(turn.apply(points[used]), corners.reshape(triangles.shape))
    return scan, {n: turn.apply(p) for n, p in marks.items()}


def test_a_face_that_is_stuck_is_led_out(reference, space, masked, monkeypatch):
    scan, true = masked
    fits = []

    def seen(reference, space, target, fit):
        again = yield from at_rest(reference, space, target, fit)
        fits.extend([fit, again])
        return again

    monkeypatch.setattr(find, "at_rest", seen)
    found = finish(find_landmarks(scan, reference)).positions
    before, after = (np.linalg.norm(space.landmarks(fit.points)["pg"] - true["pg"]) for fit in fits)
    assert before > 15 and after < 6
    assert max(np.linalg.norm(found[n] - true[n]) for n in ("n", "prn", "sn", "ch_l", "ch_r", "sto", "pg")) < 5


def _lower_by(space, down):
    """The skin (n, 3) mm of the reference, its lower face lower by ``down`` mm."""
    marks = space.landmarks(space.points)
    return space.points - np.outer(space.points[:, 2] < marks["sto"][2], [0, 0, down])


@pytest.mark.parametrize("short", [0.0, 14.0])
def test_one_that_comes_to_lie_where_it_lay_is_kept(reference, space, laid, short):
    fit = laid(space, _lower_by(space, -short))
    again = finish(at_rest(reference, space, Surface(space.points, space.triangles), fit))
    assert (again is fit) == (short == 0.0)
    assert moved(space, laid(space, space.points), again) < 0.5


def test_how_far_a_face_has_moved(space, laid):
    fit = laid(space, space.points)
    assert moved(space, fit, laid(space, space.points + [0, 3.0, 4.0])) == pytest.approx(5.0)
    beside = space.points + np.outer(space.face <= 0.5, [9.0, 0, 0])  # no part of the face
    assert moved(space, fit, laid(space, beside)) == 0.0
    ways = np.linspace(0.0, 9.0, len(space.points))
    far = moved(space, fit, laid(space, space.points + ways[:, None] * [0, 0.6, 0.8]))
    assert far == pytest.approx(np.sqrt(np.mean(ways[space.face > 0.5] ** 2)))
    twice = replace(laid(space, 2 * space.points), pose=replace(fit.pose, scale=2.0))
    assert moved(space, twice, laid(space, 2 * space.points + [0, 3.0, 4.0])) == pytest.approx(2.5)


@pytest.mark.parametrize(
    ("steps", "times"), [((2.0, 0.9), 1), ((0.9,), 0), ((2.0,) * (AGAIN + 1), AGAIN), ((2.0, 0.0), 1), ((1.1, 1.1), 2)]
)
@pytest.mark.parametrize("lost", [False, True])
def test_it_is_begun_again_while_it_moves_but_not_forever(reference, space, laid, monkeypatch, steps, times, lost):
    left = [laid(space, space.points + [AT_REST * far, 0, 0]) for far in accumulate(steps)]
    left = left[:times] + [None] if lost else left
    offered, first = list(left), laid(space, space.points)

    def begun_again(space, target, fit, size):
        yield 1.0
        return offered.pop(0)

    monkeypatch.setattr(placed_face, "begun_again", begun_again)
    # Whether it is a face is told by the scan it lies on, too.
    monkeypatch.setattr(placed_face, "judged", lambda *args: SimpleNamespace(doubtful="scan" not in args))
    fit = finish(at_rest(reference, space, "scan", first))
    assert fit is [first, *left][times]


def test_what_is_no_longer_a_face_is_not_taken(reference, space, laid, monkeypatch):
    def begun_again(space, target, fit, size):
        yield 1.0
        return laid(space, space.points + [50.0, 0, 0])

    monkeypatch.setattr(placed_face, "begun_again", begun_again)
    monkeypatch.setattr(placed_face, "judged", lambda *_: SimpleNamespace(doubtful=True))
    first = laid(space, space.points)
    assert finish(at_rest(reference, space, None, first)) is first
