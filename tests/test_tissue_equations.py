# SPDX-License-Identifier: GPL-3.0-or-later
"""The equations of Lee, Terzopoulos and Waters 1995 on cases small enough for a hand, and their invariants."""

import numpy as np
import pytest

from headshop.sim.anatomy.head import Eye, Jaw
from headshop.sim.tissue.eye_surface import gaze_direction
from headshop.sim.tissue.geometry import Surface, closest_on_triangles
from headshop.sim.tissue.jaw import jaw_transform, opening_mm
from headshop.sim.tissue.muscle_field import fibre_coordinates, theta_1, theta_2
from headshop.sim.tissue.springs import assemble, spring_energy
from headshop.sim.tissue.volume import corner_gather, prism_volumes, volume_energy, volume_forces

PRISM = np.array([[0, 1, 2, 3, 4, 5]])
UPRIGHT = np.array([[0.0, 0, 2], [3, 0, 2], [0, 4, 2], [0, 0, 0], [3, 0, 0], [0, 4, 0]])


def _turned(x, seed=1):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return x @ (q * np.sign(np.linalg.det(q))).T + [10.0, -4, 7]


def _one_spring(c=2.0, stiff=5.0, limit=0.5):
    nodes = np.array([[0.0, 0, 0], [4, 0, 0]])
    return assemble(nodes, [0], [1], np.zeros(1, int), np.array([c]), np.array([stiff]), np.array([limit]))


def test_spring_force_by_hand():
    """3.3: g = c (l - l_rest) s; 4 mm stretched to 5 mm with c = 2 pulls with 2."""
    energy, gradient = spring_energy(_one_spring(), np.array([[0.0, 0, 0], [5, 0, 0]]))
    assert energy == pytest.approx(1.0)
    assert gradient == pytest.approx(np.array([[-2.0, 0, 0], [2, 0, 0]]))


def test_biphasic_spring_by_hand():
    """Beyond half its length again the second slope counts: 4 -> 7 mm is 2 * 2 + 5 * 1."""
    energy, gradient = spring_energy(_one_spring(), np.array([[0.0, 0, 0], [7, 0, 0]]))
    assert gradient[1, 0] == pytest.approx(2 * 3 + 3 * 1)
    assert energy == pytest.approx(0.5 * 2 * 9 + 0.5 * 3 * 1)


def test_spring_forces_have_no_momentum_and_turn_with_the_body():
    rng = np.random.default_rng(0)
    nodes = rng.normal(size=(12, 3)) * 5
    first, second = np.triu_indices(12, 1)
    s = len(first)
    springs = assemble(
        nodes, first, second, np.zeros(s, int), rng.uniform(1, 9, s), rng.uniform(9, 20, s), np.full(s, 0.2)
    )
    x = nodes + rng.normal(size=nodes.shape)
    energy, gradient = spring_energy(springs, x)
    assert np.abs(gradient.sum(axis=0)).max() < 1e-9
    assert np.abs(np.cross(x, gradient).sum(axis=0)).max() < 1e-8
    assert spring_energy(springs, _turned(x))[0] == pytest.approx(energy)


def test_prism_volume_by_hand():
    """A right prism over a triangle of 3 by 4, 2 high: 12 mm³, whichever way it lies."""
    assert prism_volumes(UPRIGHT, PRISM) == pytest.approx([12.0])
    assert prism_volumes(_turned(UPRIGHT), PRISM) == pytest.approx([12.0])
    assert prism_volumes(UPRIGHT * [1, 1, -1], PRISM) == pytest.approx([-12.0])


def test_volume_forces():
    """3.6: pressure k1 (V - V_rest) / V_rest along the normal; derivative of the energy; no momentum."""
    gather = corner_gather(PRISM, 6)
    squashed = UPRIGHT * [1, 1, 0.5]
    energy, gradient = volume_energy(squashed, PRISM, np.array([12.0]), 3.0, gather)
    assert energy == pytest.approx(0.5 * 3 * 36 / 12)
    # pressure 3 * (-6) / 12 = -1.5 on 6 mm² of epidermis: 9 in all, pushing up (the force is minus the gradient)
    assert -gradient[:3, 2].sum() == pytest.approx(9.0)
    rng = np.random.default_rng(5)
    x = UPRIGHT + rng.normal(size=UPRIGHT.shape) * 0.3
    energy, gradient = volume_energy(x, PRISM, np.array([12.0]), 3.0, gather)
    assert np.abs(gradient.sum(axis=0)).max() < 1e-9
    assert np.abs(np.cross(x, gradient).sum(axis=0)).max() < 1e-9
    way = rng.normal(size=x.shape)
    ends = [volume_energy(x + h * way, PRISM, np.array([12.0]), 3.0, gather)[0] for h in (-1e-6, 1e-6)]
    assert (ends[1] - ends[0]) / 2e-6 == pytest.approx((gradient * way).sum(), rel=1e-5)


def test_muscle_scaling_functions():
    """Figure 8: Theta_1 is 0 at the root and full at the free end; Theta_2 full on it and 0 beyond its width."""
    e = np.linspace(-0.2, 1.0, 60)
    assert (np.diff(theta_1(e)) >= 0).all() and theta_1(np.array([-0.1, 0.0, 1.0])).tolist() == [0, 0, 1]
    w = np.linspace(0, 1.5, 60)
    assert (np.diff(theta_2(w)) <= 1e-12).all() and theta_2(0.0) == 1 and theta_2(1.2) == pytest.approx(0)


def test_length_ratio_sums_segments():
    """3.5: the ratio counts the segments passed; depth under the skin does not widen."""
    fibre = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0]])
    points = np.array([[5.0, 2, 3], [12.0, 5, -4]])
    normal = np.tile([0.0, 0, 1], (2, 1))
    epsilon, omega, deep, direction = fibre_coordinates(points, normal, fibre)
    assert epsilon == pytest.approx([0.25, 0.75])
    assert omega == pytest.approx([2.0, 2.0]) and deep == pytest.approx([3.0, -4.0])
    assert direction == pytest.approx(np.array([[-1.0, 0, 0], [0, -1, 0]]))


def _jaw():
    return Jaw(np.array([50.0, 10, -5]), np.array([-50.0, 10, -5]), np.array([0, -75.0, -50]), open_max=0.5)


def test_jaw_opens_down_and_back_with_sliding_condyles():
    rotation, translation = jaw_transform(_jaw(), 1.0)
    incisor = rotation @ _jaw().incisor + translation
    condyle = rotation @ _jaw().condyle_l + translation
    assert incisor[2] < _jaw().incisor[2] - 25 and abs(incisor[0]) < 1e-9
    slide = condyle - _jaw().condyle_l
    assert np.linalg.norm(slide) == pytest.approx(_jaw().slide_max) and slide[1] < 0 and slide[2] < 0
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert opening_mm(_jaw(), 0.2) < opening_mm(_jaw(), 0.6) < opening_mm(_jaw(), 1.0)


def test_jaw_at_rest_protruding_and_sideways():
    rotation, translation = jaw_transform(_jaw(), 0.0)
    assert np.allclose(rotation, np.eye(3)) and np.allclose(translation, 0)
    _, translation = jaw_transform(_jaw(), 0.0, 1.0)
    assert np.linalg.norm(translation) == pytest.approx(_jaw().forward_max) and translation[1] < -5
    for side in (1.0, -1.0):
        rotation, translation = jaw_transform(_jaw(), 0.0, 0.0, side)
        moved = rotation @ _jaw().incisor + translation - _jaw().incisor
        assert moved[0] * side == pytest.approx(_jaw().side_max, rel=0.1)


def test_gaze_turns_left_and_up():
    eye = Eye(np.zeros(3), 12.0, np.array([0.0, -1, 0]))
    assert gaze_direction(eye, np.array([0.3, 0.0]))[0] == pytest.approx(np.sin(0.3))
    assert gaze_direction(eye, np.array([0.0, 0.3]))[2] == pytest.approx(np.sin(0.3))


def test_closest_points_on_a_triangle():
    a, b, c = (np.tile(p, (4, 1)) for p in ([0.0, 0, 0], [4.0, 0, 0], [0.0, 4, 0]))
    points = np.array([[1.0, 1, 5], [-2, -3, 1], [3, 3, 0], [2, -1, 0]])
    expected = np.array([[1.0, 1, 0], [0, 0, 0], [2, 2, 0], [2, 0, 0]])
    assert closest_on_triangles(points, a, b, c) == pytest.approx(expected)
    surface = Surface(np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0]]), np.array([[0, 1, 2]]))
    found, triangle, distance = surface.closest(points)
    assert found == pytest.approx(expected) and distance[0] == pytest.approx(5) and (triangle == 0).all()


def test_a_crushed_prism_resists_more():
    """k1 (V - V_rest) / V_rest, and under a share c of the volume h times k1 (V - c V_rest) / V_rest besides."""
    x = UPRIGHT.T.copy()
    rest = prism_volumes(UPRIGHT, PRISM)

    def pressed(share, *crushed):
        y = x.copy()
        y[2] *= share
        return volume_forces(y, PRISM, rest, 3.0, *crushed)

    for share in (1.2, 0.5):
        assert pressed(share, 0.3, 10.0)[0] == pytest.approx(pressed(share)[0])
        assert pressed(share, 0.3, 10.0)[1] == pytest.approx(pressed(share)[1])
    energy, force = pressed(0.1, 0.3, 10.0)
    assert energy == pytest.approx(0.5 * 3.0 * rest[0] * (0.9**2 + 10 * 0.2**2))
    assert force == pytest.approx(pressed(0.1)[1] * (0.9 + 10 * 0.2) / 0.9)
