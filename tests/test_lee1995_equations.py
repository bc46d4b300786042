# SPDX-License-Identifier: GPL-3.0-or-later
"""Each equation of Lee, Terzopoulos and Waters 1995, section 3, on a case small enough for a hand, and its invariants."""

import numpy as np
import pytest

from headshop.sim.tissue.lee1995 import constants, elements, muscles, piecewise, pucker, puff, skull, stability, volume
from headshop.sim.tissue.lee1995.constants import DEFAULT, Constants
from headshop.sim.tissue.lee1995.stress_strain import spring_forces, tension
from headshop.sim.tissue.planes import Planes
from headshop.sim.tissue.springs import assemble, spring_energy

TRIANGLE = np.array([[0, 1, 2]])
#: One prism of 3 by 4 mm and 2 mm thick over its skull: epidermis, fascia, bone.
CORNERS = np.array([[0.0, 0, 0], [3, 0, 0], [0, 4, 0]])
PRISM = np.concatenate([CORNERS + [0, 0, 5], CORNERS + [0, 0, 3], CORNERS])
MOVING = np.arange(9) < 6
NO_TIES = np.zeros((0, 2), int)


def _one(shape=PRISM):
    return elements.build_elements(TRIANGLE, shape, MOVING)


def _turn(seed=1):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def test_parameters_of_3_10():
    c = Constants()
    assert (c.mass, c.time_step, c.damping) == (0.5, 0.01, 30)
    assert (c.epidermis, c.dermal_fatty, c.dermal_fatty_stiff, c.fascia, c.muscle_layer) == (60, 30, 70, 80, 10)
    assert constants.DEFAULT == c


def test_a_prism_has_the_springs_of_figure_6():
    springs = elements.build_springs(TRIANGLE, PRISM, MOVING, DEFAULT, NO_TIES)
    # three along each edge of epidermis and fascia; three upright and six across in each layer below
    assert np.bincount(springs.kind, minlength=4).tolist()[:4] == [3, 9, 3, 9]
    assert [set(springs.stiffness[springs.kind == k]) for k in range(4)] == [{60}, {30}, {80}, {10}]
    assert set(springs.stiff[springs.kind == elements.DERMAL_FATTY]) == {70}
    pairs = set(zip(springs.first.tolist(), springs.second.tolist(), strict=True))
    assert {(0, 1), (0, 3), (3, 6), (3, 4)} <= pairs and not {(0, 6), (6, 7)} & pairs


def test_elements_share_a_spring_once():
    both = np.array([[0, 1, 2], [1, 3, 2]])
    flat = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [4, 4, 0]])
    nodes = np.concatenate([flat + [0, 0, 5], flat + [0, 0, 3], flat])
    springs = elements.build_springs(both, nodes, np.arange(12) < 8, DEFAULT, NO_TIES)
    pairs = np.sort(np.stack([springs.first, springs.second], axis=1), axis=1)
    assert len(np.unique(pairs, axis=0)) == len(pairs) and (springs.kind == elements.EPIDERMIS).sum() == 5


def test_spring_force():
    """g = c (l - l_rest) s: 4 mm at 6 mm with c = 2 pulls with 4 toward the other end; -2 pushes when 1 mm short."""
    springs = assemble(np.array([[0.0, 0, 0], [4, 0, 0]]), [0], [1], [0], np.array([2.0]), np.array([2.0]), [np.inf])
    assert spring_forces(springs, np.array([[0.0, 0, 0], [0, 6, 0]])) == pytest.approx(
        np.array([[0, 4.0, 0], [0, -4, 0]])
    )
    assert tension(springs, np.array([3.0])) == pytest.approx([-2])


def test_dermal_fatty_springs_are_biphasic():
    """30 up to a strain of 0.3, then 70: 10 mm at 15 mm is 30 * 5 + 40 * 2; no jump where the phase changes."""
    springs = assemble(np.array([[0.0, 0, 0], [10, 0, 0]]), [0], [1], [1], np.array([30.0]), np.array([70.0]), [0.3])
    assert tension(springs, np.array([15.0])) == pytest.approx([230])
    before, after = (tension(springs, np.array([13.0 + h]))[0] for h in (-1e-6, 1e-6))
    assert after - before == pytest.approx(0, abs=1e-3) and before == pytest.approx(90, abs=1e-3)


def test_spring_forces_conserve_momentum_and_are_those_of_an_energy():
    rng = np.random.default_rng(0)
    springs = elements.build_springs(TRIANGLE, PRISM, MOVING, DEFAULT, NO_TIES)
    assert np.abs(spring_forces(springs, PRISM @ _turn().T + [3, 1, 2])).max() < 1e-9  # rigid motion
    x = PRISM + rng.normal(size=PRISM.shape)
    force = spring_forces(springs, x)
    assert np.abs(force.sum(axis=0)).max() < 1e-9 and np.abs(np.cross(x, force).sum(axis=0)).max() < 1e-9
    assert force == pytest.approx(-spring_energy(springs, x)[1])
    assert spring_forces(springs, x @ _turn().T) == pytest.approx(force @ _turn().T)


def test_linear_muscle():
    """3.4 by hand: a muscle of 10 mm along x, fixed at 0; half way, 3 mm beside and 4 mm under it."""
    free, fixed, up = np.array([10.0, 0, 0]), np.zeros(3), np.array([0.0, 0, 1])
    point = np.array([[5.0, 3, -4]])
    assert muscles.length_ratio(point, free, fixed) == pytest.approx([0.5])
    omega, above = muscles.width(point, free, fixed, up)
    assert omega == pytest.approx([3]) and above == pytest.approx([4])
    assert muscles.width(np.array([[12.0, 0, 0]]), free, fixed, up)[0] == pytest.approx([2])  # beyond the free end
    force = muscles.muscle_forces(point, free, fixed, up, 6.0)
    assert force == pytest.approx(np.array([[-0.25, 0, 0]]))  # sin² 45° cos² 45° toward the bone
    assert muscles.muscle_forces(point - [0, 0, 20], free, fixed, up, 6.0) == pytest.approx(0)


def test_muscle_force_is_zero_at_the_root_and_full_near_the_end():
    free, fixed, up = np.array([20.0, 0, 0]), np.zeros(3), np.array([0.0, 0, 1])
    along = np.linspace([0.0, 0, 0], free, 30)
    size = np.linalg.norm(muscles.muscle_forces(along, free, fixed, up, 5.0), axis=1)
    assert size[0] == pytest.approx(0) and size[-1] == pytest.approx(1) and (np.diff(size) > 0).all()
    beside = free + np.linspace([0.0, 0, 0], [0.0, 6, 0], 30)
    size = np.linalg.norm(muscles.muscle_forces(beside, free, fixed, up, 5.0), axis=1)
    assert (np.diff(size) <= 1e-12).all() and size[-1] == pytest.approx(0)


def test_piecewise_linear_muscle():
    """3.5 by hand: 10 mm along x, then 30 along y to the fixed end; the ratio counts what is left of the way."""
    chain = np.array([[0.0, 0, 0], [10, 0, 0], [10, 30, 0]])
    normals = np.tile([0.0, 0, 1], (2, 1))
    points = np.array([[4.0, 1, 0], [11.0, 20, 2]])
    segment, omega, above = piecewise.nearest_segment(points, chain, normals)
    assert segment.tolist() == [0, 1] and omega == pytest.approx([1, 1]) and above == pytest.approx([0, -2])
    assert piecewise.length_ratio(points, chain, segment) == pytest.approx([36 / 40, 10 / 40])
    force = piecewise.muscle_forces(points, chain, normals, 4.0)
    assert force[0, 0] > 0 and force[1, 1] > 0 and np.abs(force[[0, 1], [1, 0]]).max() < 1e-12


def test_one_segment_is_a_linear_muscle():
    rng = np.random.default_rng(2)
    free, fixed, up = np.array([9.0, 1, 0]), np.array([-3.0, 4, 0]), np.array([0.0, 0, 1])
    points = rng.uniform(-4, 9, (40, 3))
    linear = muscles.muscle_forces(points, free, fixed, up, 5.0)
    assert piecewise.muscle_forces(points, np.stack([free, fixed]), up[None], 5.0) == pytest.approx(linear)


def test_measured_volume():
    assert volume.measured(PRISM, np.arange(6)[None])[0] == pytest.approx([12])
    turned = PRISM @ _turn().T
    assert volume.measured(turned, np.arange(6)[None])[0] == pytest.approx([12])


def test_squeezed_element_pushes_its_epidermis_out():
    """3.6 by hand: 2 mm to 1 mm loses 6 mm³; with k1 = 2 each epidermal node is pushed out with 12."""
    squeezed = PRISM.copy()
    squeezed[:3, 2] -= 1
    rest = volume.turned_rest(_one(), PRISM, np.zeros(3), np.eye(3))
    force = volume.volume_forces(_one(), squeezed, rest, Constants(volume=2.0, shape=0.0))
    assert force[:3] == pytest.approx(np.tile([0, 0, 12.0], (3, 1))) and np.abs(force[3:]).max() == 0
    swollen = volume.volume_forces(_one(), 2 * PRISM - squeezed, rest, Constants(volume=2.0, shape=0.0))
    assert swollen[:3] == pytest.approx(-force[:3])


def test_bent_element_returns_to_its_shape():
    """3.6's second term by hand: one corner 6 mm out moves the centre of mass by 1, so k2 = 1 pulls it back with 5."""
    bent = PRISM.copy()
    bent[0, 0] += 6
    rest = volume.turned_rest(_one(), PRISM, np.zeros(3), np.eye(3))
    force = volume.volume_forces(_one(), bent, rest, Constants(volume=0.0, shape=1.0))
    assert force[:6, 0] == pytest.approx([-5, 1, 1, 1, 1, 1]) and np.abs(force[:, 1:]).max() < 1e-12
    assert np.abs(force.sum(axis=0)).max() < 1e-12


def test_elements_do_not_mind_motion_with_the_jaw():
    turn = _turn(4)
    rest = volume.turned_rest(_one(), PRISM, np.ones(3), turn)
    assert np.abs(volume.volume_forces(_one(), PRISM @ turn.T + [5, 6, 7], rest, DEFAULT)).max() < 1e-9
    still = volume.turned_rest(_one(), PRISM, np.zeros(3), turn)
    assert np.abs(volume.volume_forces(_one(), PRISM + [5, 6, 7], still, DEFAULT)).max() < 1e-9


def _plane(level=0.0, partner=-1):
    return Planes(np.array([0]), np.array([[0.0, 0, 1]]), np.array([level]), np.array([partner]))


def test_skull_cancels_what_points_into_it():
    """3.7: s = -(f · n) n where f · n < 0 on the bone; what is left slides. Off the bone, or outward, nothing."""
    force = np.array([[3.0, -1, -4]])
    assert skull.skull_forces(_plane(), np.zeros((1, 3)), force) == pytest.approx(np.array([[0, 0, 4.0]]))
    assert np.abs(skull.skull_forces(_plane(), np.array([[0, 0, 1.0]]), force)).max() == 0
    assert np.abs(skull.skull_forces(_plane(), np.zeros((1, 3)), -force)).max() == 0


def test_no_node_coasts_through_bone():
    x, v = np.array([[0.0, 0, 0.5]]), np.array([[10.0, 0, -400]])
    kept = skull.arrested(_plane(), x, v, 0.01)
    assert (x + 0.01 * kept)[0] == pytest.approx([0.1, 0, 0])
    assert skull.arrested(_plane(), x, -v, 0.01) == pytest.approx(-v)
    out = skull.arrested(_plane(1.0), x, np.zeros((1, 3)), 0.01)
    assert out[0, 2] > 0 and 0.5 < 0.5 + 0.01 * out[0, 2] < 1.0  # inside: it comes out, not all at once


def test_two_sides_of_flesh_share_a_contact():
    x = np.array([[0.0, 0, 0], [0, 0, 0]])
    pair = skull.arrested(_plane(0.0, 1), x, np.array([[0.0, 0, -6], [0, 0, 2]]), 0.01)
    assert pair[:, 2] == pytest.approx([-2, -2])


def test_pursing_and_protruding():
    """Section 5: toward the middle across the way out, and out, most in the middle."""
    centre, forward, half = np.zeros(3), np.array([0.0, -1, 0]), np.array([30.0, 10, 10])
    points = np.array([[28.0, 3, 0], [0, -2, 8], [-28.0, 0, 0]])
    inward = pucker.pursing(points, centre, forward, half)
    assert inward == pytest.approx(np.array([[-1.0, 0, 0], [0, 0, -1], [1, 0, 0]]))
    out = pucker.protruding(points, centre, forward, 30.0)
    assert (out[:, 1] < 0).all() and out[1, 1] < out[0, 1] and out[0, 1] == pytest.approx(out[2, 1])
    assert np.abs(pucker.protruding(np.array([[31.0, 0, 0]]), centre, forward, 30.0)).max() < 1e-12


def test_puffing_is_radial():
    assert puff.radial(np.array([[0.0, 3, 4], [2, 0, 0]]), np.zeros(3)) == pytest.approx(
        np.array([[0, 0.6, 0.8], [1.0, 0, 0]])
    )


@pytest.mark.parametrize("stiffness", [1e3, 1e5, 1e7])
def test_time_step_is_at_the_edge_of_stability(stiffness):
    """Euler's scheme of 3.9 on one spring: bounded just under the longest step, lost just over it."""
    c = Constants(time_step=np.inf)
    longest = stability.stable_step(stiffness, c, margin=1.0)
    for factor, bounded in ((0.98, True), (1.02, False)):
        dt, x, v = factor * longest, 1.0, 0.0
        for _ in range(3000):
            v += dt * (-stiffness * x - c.damping * v) / c.mass
            x += dt * v
            if abs(x) > 1e6:
                break
        assert (abs(x) < 1e3) == bounded
    assert stability.stable_step(100.0, DEFAULT) == 0.01  # the paper's, where it is stable


def test_stiffness_is_bounded():
    springs = elements.build_springs(TRIANGLE, PRISM, MOVING, DEFAULT, NO_TIES)
    bound = stability.stiffest(springs, _one(), np.array([6.0]), np.zeros(9), DEFAULT)
    h = 1e-6
    rest = volume.turned_rest(_one(), PRISM, np.zeros(3), np.eye(3))

    def force(x):
        return spring_forces(springs, x) + volume.volume_forces(_one(), x, rest, DEFAULT)

    columns = []
    for k in range(18):
        x = PRISM.copy()
        x.ravel()[k] += h
        columns.append((force(PRISM) - force(x)).ravel()[:18] / h)
    largest = np.abs(np.linalg.eigvals(np.stack(columns, axis=1))).max()
    assert largest < bound < 6 * largest
