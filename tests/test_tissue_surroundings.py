# SPDX-License-Identifier: GPL-3.0-or-later
"""Gravity, inertial forces of a moving head and wind: by hand on single masses and plates, then on the flat patch."""

from dataclasses import replace

import numpy as np
import pytest

from headshop.sim.acting.pose import Pose, control
from headshop.sim.mesh import vertex_normals
from headshop.sim.tissue.model import build_model
from headshop.sim.tissue.solver import solve
from headshop.sim.tissue.surroundings import (
    AIR,
    STANDARD_GRAVITY,
    Surroundings,
    apparent_acceleration,
    outer_forces,
    wind_force,
)

UP_SIDE_DOWN = Surroundings(gravity=-STANDARD_GRAVITY)


@pytest.fixture(scope="module")
def model(flat_patch):
    return build_model(flat_patch(13, 72.0), table={"zygomaticus_major": {"excursion_mm": 8.0}})


def at_rest_in(model, around):
    solution = solve(model, replace(control(model, Pose()), around=around), max_iterations=200, tolerance=1e-4)
    assert solution.converged
    return solution.state.positions


def test_as_scanned_nothing_is_felt(model):
    same = Surroundings(gravity=np.array([0, 0, -9806.65]))
    assert same.idle and outer_forces(model, same, model.layers.nodes, None, None) is None
    np.testing.assert_array_equal(at_rest_in(model, same), model.layers.nodes)


def test_each_inertial_force_by_hand():
    at, speed = np.array([[100.0, 0, 0]]), np.array([[0.0, 30, 0]])
    turning = Surroundings(spin=np.array([0, 0, 2.0]))
    assert apparent_acceleration(turning, at)[0] == pytest.approx([400, 0, 0])  # w² r outwards
    assert apparent_acceleration(turning, at, speed)[0] == pytest.approx([400 + 120, 0, 0])  # and 2 w v
    starting = Surroundings(spin_rate=np.array([0, 0, 5.0]))
    assert apparent_acceleration(starting, at)[0] == pytest.approx([0, -500, 0])
    pushed = Surroundings(acceleration=np.array([7.0, 0, 0]))
    assert apparent_acceleration(pushed, at)[0] == pytest.approx([-7, 0, 0])
    assert apparent_acceleration(UP_SIDE_DOWN, at)[0] == pytest.approx([0, 0, 2 * 9806.65])


def test_a_free_mass_flies_straight_seen_from_a_tumbling_head():
    """Integrated in the head's frame, which speeds up, turns ever faster and is pushed: a straight line in the room."""
    place, speed = np.array([40.0, -20, 10]), np.array([100.0, 50, -30])
    spin_rate, push = np.array([0, 0, 6.0]), np.array([0.0, 900, 0])
    count, dt = 2000, 0.5 / 2000

    def felt(t, x, v):
        angle = 0.5 * spin_rate[2] * t * t  # turned about z by now
        c, s = np.cos(angle), np.sin(angle)
        inward = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        around = Surroundings(acceleration=inward @ push, spin=spin_rate * t, spin_rate=spin_rate)
        return apparent_acceleration(around, x[None], v[None])[0], inward

    x, v = place, speed
    for k in range(count):  # the midpoint rule
        a, _ = felt(k * dt, x, v)
        a, _ = felt((k + 0.5) * dt, x + 0.5 * dt * v, v + 0.5 * dt * a)
        x, v = x + dt * v + 0.5 * dt * dt * a, v + dt * a
    room = place + speed * 0.5 - 0.5 * push * 0.25
    inward = felt(0.5, x, v)[1]
    np.testing.assert_allclose(x, inward @ room, atol=1e-3)


def test_gravity_and_acceleration_are_one(model):
    """The equivalence principle: what a push does, a change of gravity by the opposite does."""
    push = np.array([3000.0, -2000, 4000])
    pushed = at_rest_in(model, Surroundings(acceleration=push))
    weighed = at_rest_in(model, Surroundings(gravity=STANDARD_GRAVITY - push))
    np.testing.assert_allclose(pushed, weighed, atol=1e-9)
    assert np.abs(pushed - model.layers.nodes).max() > 0.05


def test_free_fall_has_no_weight_whichever_way_up(model):
    falls = [Surroundings(gravity=g, acceleration=g) for g in (STANDARD_GRAVITY, np.array([9806.65, 0, 0]))]
    falls.append(Surroundings(gravity=np.zeros(3)))
    one, two, three = (at_rest_in(model, around) for around in falls)
    np.testing.assert_allclose(one, two, atol=1e-9)
    np.testing.assert_allclose(one, three, atol=1e-9)
    lifted = (one - model.layers.nodes)[: model.count, 2]
    assert lifted.max() > 0.05 and lifted.min() > -0.02  # tissue over the bone rises


def test_a_spinning_patch_is_thrown_outwards_by_the_sum_of_its_masses(model):
    around = Surroundings(spin=np.array([0, 0, 12.0]))
    force = outer_forces(model, around, model.layers.nodes, None, None)
    r = model.layers.nodes[: 2 * model.count]
    np.testing.assert_allclose(force[:, :2], 144.0 * model.mass[:, None] * r[:, :2], atol=1e-9)
    assert np.abs(force[:, 2]).max() < 1e-12
    outward = (at_rest_in(model, around) - model.layers.nodes)[: 2 * model.count]
    free = model.layers.free
    assert np.einsum("ij,ij->i", outward[free, :2], r[free, :2]).min() > -1e-6


def test_wind_presses_on_what_faces_it():
    normals = np.array([[0, -1.0, 0], [0, 1.0, 0], [0, -np.sqrt(0.5), np.sqrt(0.5)]])
    force = wind_force(np.array([0, 20000.0, 0]), normals, np.array([3.0, 3.0, 3.0]))
    stagnation = 0.5 * AIR * 20000.0**2 * 3
    assert force[0] == pytest.approx([0, stagnation, 0])
    assert np.abs(force[1]).max() == 0
    assert force[2] == pytest.approx(0.5 * stagnation * -normals[2])


def test_drag_of_a_sphere_is_half_its_stagnation_pressure():
    """The integral of cos² over the half that faces the wind, along it: a half of the cross-section."""
    u, v = np.meshgrid((np.arange(200) + 0.5) / 200, (np.arange(400) + 0.5) / 400 * 2 * np.pi, indexing="ij")
    z = 1 - 2 * u.ravel()
    ring = np.sqrt(1 - z * z)
    normals = np.stack([ring * np.cos(v.ravel()), ring * np.sin(v.ravel()), z], axis=1)
    area = np.full(len(z), 4 * np.pi * 50.0**2 / len(z))
    total = wind_force(np.array([0, 5000.0, 0]), normals, area).sum(axis=0)
    expected = 0.5 * AIR * 5000.0**2 * np.pi * 50.0**2 * 0.5
    assert total == pytest.approx([0, expected, 0], rel=1e-3, abs=1e-3 * expected)


def test_wind_dents_the_patch_and_reaches_no_lining(model):
    around = Surroundings(wind=np.array([0, 0, -40000.0]))
    dented = (at_rest_in(model, around) - model.layers.nodes)[: model.count, 2]
    assert dented.min() < -0.05 and dented.max() < 0.01
    behind = Surroundings(wind=np.array([0, 0, 40000.0]))
    np.testing.assert_allclose(at_rest_in(model, behind), model.layers.nodes, atol=1e-9)
    lined = replace(model, exposed=np.zeros(model.count, bool))
    normals = vertex_normals(model.layers.nodes[: model.count], model.contacts.triangles)
    assert not outer_forces(lined, around, model.layers.nodes, None, lambda: normals).any()
