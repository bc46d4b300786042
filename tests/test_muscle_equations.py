# SPDX-License-Identifier: GPL-3.0-or-later
"""Muscles of Waters 1986 on plain arrays: each equation by hand, then what must hold for all of them."""

import numpy as np
import pytest

from headshop.sim.muscle import lids
from headshop.sim.muscle.confluence import common_zone, contracted, resultant, sharing
from headshop.sim.muscle.elasticity import elastic
from headshop.sim.muscle.jaw import jaw_share, turned
from headshop.sim.muscle.linear import LinearMuscle, angular, radial
from headshop.sim.muscle.sheet import SheetMuscle
from headshop.sim.muscle.sphincter import Sphincter, ellipse

HALF = np.sqrt(0.5)  # cos of half a right angle
#: The muscles of figures 15 (b), 16 (b) and 17 (b).
LINEAR = LinearMuscle(np.zeros(3), np.array([0, -10.0, 0]), np.radians(35), 7.0, 14.0, spring=0.75)
SPHINCTER = Sphincter(np.zeros(3), np.eye(3), (9.0, 4.0), spring=0.9)
SHEET = SheetMuscle(np.zeros(3), np.array([0, -10.0, 0]), 4.4, 3.0, spring=0.3)
EACH = pytest.mark.parametrize("muscle", [LINEAR, SPHINCTER, SHEET], ids=["linear", "sphincter", "sheet"])


def at(*point):
    return np.array([point], dtype=float)


def plane(side=20.0, step=0.25):
    """A flat mesh's vertices in the x, y plane."""
    line = np.arange(-side, side + step, step)
    x, y = np.meshgrid(line, line)
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)


def test_the_linear_muscle_pulls_most_at_the_start_of_its_fall_off():
    for distance, factor in ((0, 0), (3.5, HALF), (7, 1), (10.5, HALF), (14, 0), (15, 0)):
        assert LINEAR.displacement(at(0, -distance, 0), 1.0)[0] == pytest.approx([0, 0.75 * factor * distance, 0])


def test_the_linear_muscle_pulls_toward_its_head_and_less_to_the_side():
    angle = np.radians(17.5)
    point = 7 * at(np.sin(angle), -np.cos(angle), 0)
    assert LINEAR.displacement(point, 0.5) == pytest.approx(-0.5 * 0.75 * HALF * point)
    assert angular(np.radians(60), np.pi / 2) == pytest.approx(0.5)  # a right angle: the cos(psi) of the thesis
    assert radial([2.0, 6.0], 4.0, 8.0) == pytest.approx([HALF, HALF])


def test_elasticity_draws_the_pull_to_its_peak():
    assert elastic(np.array([0.0, 0.5, 1.0]), 10.0) == pytest.approx([0, 0.5**10, 1])
    stiff = LinearMuscle(LINEAR.head, LINEAR.tail, LINEAR.zone, 7.0, 14.0, 0.75, elasticity=10.0)
    assert stiff.influence(at(0, -3.5, 0)) == pytest.approx(HALF**10) and stiff.influence(at(0, -7, 0)) == 1


def test_the_sphincter_draws_an_ellipse_together():
    assert SPHINCTER.displacement(at(4.5, 0, 3), 1.0)[0] == pytest.approx([-0.9 * 0.5 * 4.5, 0, 0])
    assert SPHINCTER.displacement(at(0, 2, 0), 1.0)[0] == pytest.approx([0, -0.9 * 0.5 * 2, 0])
    turn = np.linspace(0, 2 * np.pi, 20)
    assert ellipse(9 * np.cos(turn), 4 * np.sin(turn), 9, 4) == pytest.approx(np.zeros(20), abs=1e-12)
    assert ellipse(0.0, 0.0, 9, 4) == 1
    pouting = Sphincter(np.zeros(3), np.eye(3), (9.0, 4.0), spring=0.9, pout=0.5)
    assert pouting.displacement(at(0, 2, 0), 1.0)[0] == pytest.approx([0, -0.9, 0.9 * 0.5 * 0.5 * 4])


def test_the_sheet_shortens_evenly_and_in_parallel():
    assert SHEET.displacement(at(0, -10, 0), 1.0)[0] == pytest.approx([0, 3, 0])
    assert SHEET.displacement(at(0, -5, 0), 1.0)[0] == pytest.approx([0, 1.5, 0])
    assert SHEET.displacement(at(2.2, -5, 0), 1.0)[0] == pytest.approx([0, 1.5 * HALF, 0])
    assert SHEET.displacement(at(0, -11.5, 0), 1.0)[0] == pytest.approx([0, 3 * HALF, 0])


@EACH
def test_no_tension_no_motion(muscle):
    points = plane()
    assert (contracted(points, [muscle], [0.0]) == points).all()
    assert not muscle.displacement(points, 0.0).any()


@EACH
def test_nothing_moves_outside_the_zone_and_nothing_breaks_off_at_its_border(muscle):
    points = plane()
    count = int(np.sqrt(len(points)))
    moved = muscle.displacement(points, 1.0)
    outside = muscle.influence(points) == 0
    assert 0.4 < outside.mean() < 1 and not moved[outside].any()
    grid = moved.reshape(count, count, 3)
    jump = max(np.abs(np.diff(grid, axis=a)).max() for a in (0, 1))
    finer = muscle.displacement(plane(step=0.125), 1.0).reshape(2 * count - 1, 2 * count - 1, 3)
    # a border that breaks off keeps its jump however fine the mesh
    assert max(np.abs(np.diff(finer, axis=a)).max() for a in (0, 1)) < 0.6 * jump


@EACH
def test_more_tension_moves_more_and_mirrors(muscle):
    points = plane()
    lengths = [np.linalg.norm(muscle.displacement(points, t), axis=1) for t in (0.25, 0.5, 1.0)]
    moving = lengths[2] > 0
    assert (lengths[0][moving] < lengths[1][moving]).all() and (lengths[1][moving] < lengths[2][moving]).all()
    flip = [-1, 1, 1]
    assert muscle.displacement(points * flip, 0.7) == pytest.approx(muscle.displacement(points, 0.7) * flip)


def test_muscles_that_meet_add_up_by_the_parallelogram():
    other = LinearMuscle(np.array([14.0, -10, 0]), np.array([4.0, -10, 0]), np.radians(60), 8.0, 16.0, spring=0.5)
    points = plane()
    both = resultant(points, [LINEAR, other], [1.0, 0.6])
    assert both == pytest.approx(LINEAR.displacement(points, 1.0) + other.displacement(points, 0.6))
    assert both == pytest.approx(resultant(points, [other, LINEAR], [0.6, 1.0]))
    zone = common_zone(points, [LINEAR, other])
    assert zone.any() and not zone[LINEAR.influence(points) == 0].any()


def test_equal_muscles_share_the_skin_that_they_pull():
    lengths = np.array([[3.0, 0.0], [3.0, 3.0], [3.0, 0.01], [0.0, 0.0]])
    assert sharing(lengths, lengths**2, np.ones(2)) == pytest.approx([1, 0.5**0.25, 1, 1], abs=0.004)
    assert sharing(lengths, lengths**2, np.zeros(2)) == pytest.approx(np.ones(4))


HINGE = np.array([[60.0, 0, 0], [-60.0, 0, 0]])
CORNERS = np.array([[25.0, -80, -50], [-25.0, -80, -50]])


def test_corners_of_the_mouth_turn_by_half_the_angle_of_the_jaw():
    points = np.array(
        [*CORNERS, [0, -90, -50.0], [0, -90, -60.0], [0, -75, -95], [0, -95, -20], [0, 60, -90], [30, -90, 40]]
    )
    share = jaw_share(points, HINGE, CORNERS)
    assert share == pytest.approx([0.5, 0.5, 0, 1, 1, 0, 0, 0], abs=1e-6)


def test_skin_that_turns_by_a_share_keeps_its_distance_from_the_hinge():
    angle = np.radians(20)
    c, s = np.cos(angle), np.sin(angle)
    rotation = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    points = np.array([*CORNERS, [0, -75, -95.0], [0, -95, -20]])
    share = jaw_share(points, HINGE, CORNERS)
    moved = turned(points, share, rotation, np.zeros(3), np.zeros(3))
    assert np.hypot(*moved[:, 1:].T) == pytest.approx(np.hypot(*points[:, 1:].T))
    turn = np.arctan2(moved[:, 2], moved[:, 1]) - np.arctan2(points[:, 2], points[:, 1])
    assert turn == pytest.approx([angle / 2, angle / 2, angle, 0], abs=1e-9)


def test_lids_turn_over_the_eyeball():
    centre = np.array([30.0, -80, 10])
    lid = centre + 12.5 * np.array([[0, -np.cos(a), np.sin(a)] for a in np.radians([20, 40, 60])])
    shut = lids.closed(lid, np.array([1.0, 0.5, 0.0]), centre, np.array([1.0, 0, 0]), np.radians(30))
    assert np.linalg.norm(shut - centre, axis=1) == pytest.approx([12.5] * 3)
    assert np.degrees(np.arctan2(shut[:, 2] - 10, -80 - shut[:, 1])) == pytest.approx([-10, 25, 60])
