# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion in time: order of the scheme, energy, momentum of what acts, few quasi-Newton steps, the head under gravity."""

from dataclasses import replace

import numpy as np
import pytest

from headshop.sim.acting.pose import Pose, control
from headshop.sim.tissue.dynamics import GAMMA, Memory, control_between, step
from headshop.sim.tissue.energy import find_contacts, pose_of
from headshop.sim.tissue.forces import energy_gradient
from headshop.sim.tissue.model import build_model
from headshop.sim.tissue.solver import rest_state, solve
from headshop.sim.tissue.surroundings import STANDARD_GRAVITY, Surroundings

NAME = "zygomaticus_major_l"


@pytest.fixture(scope="module")
def model(flat_patch):
    return build_model(flat_patch(13, 72.0), table={"zygomaticus_major": {"excursion_mm": 8.0}})


def act(model, **around):
    return replace(control(model, Pose()), around=Surroundings(**around))


def test_rest_stays_the_scan_to_the_bit(model):
    state = step(model, rest_state(model), control(model, Pose()), 1 / 24)
    np.testing.assert_array_equal(state.positions, model.layers.nodes)
    np.testing.assert_array_equal(state.velocities, 0 * model.layers.nodes)


def test_a_control_between_two():
    class_model = type("M", (), {"muscle_names": ("a_l",)})
    one = control(class_model, Pose({"a_l": 0.2}, jaw_open=0.5))
    other = replace(control(class_model, Pose({"a_l": 1.0})), seal=1.0, around=Surroundings(wind=np.array([0, 8.0, 0])))
    middle = control_between(one, other, 0.25)
    assert middle.activations == pytest.approx([0.4]) and middle.jaw == pytest.approx([0.375, 0, 0])
    assert middle.seal == pytest.approx(0.25) and middle.around.wind == pytest.approx([0, 2, 0])
    assert middle.around.gravity == pytest.approx(STANDARD_GRAVITY)


def test_the_scheme_is_of_order_two(model):
    """Tissue floating without weight, let go: halving the step takes the error down fourfold (implicit Euler: twofold)."""
    start = solve(model, act(model, gravity=np.zeros(3)), max_iterations=300, tolerance=1e-6).state
    still = control(model, Pose())

    def after(count):
        state = start
        for _ in range(count):
            state = step(model, state, still, 0.005 / count, rounds=60, tolerance=1e-10)
        return state.positions

    exact = after(64)
    coarse, fine = (np.abs(after(count) - exact).max() for count in (4, 8))
    assert coarse > 1e-3 and coarse / fine > 3.5


def test_energy_decays_without_input(model):
    pulled = solve(model, control(model, Pose({NAME: 1.0}))).state
    still = control(model, Pose())
    pose = pose_of(model, still)

    def total(state):
        stored, _ = energy_gradient(model, pose, find_contacts(model, pose, state.positions), state.positions)
        speed = (state.velocities[: 2 * model.count] ** 2).sum(axis=1)
        return stored + 0.5 * model.mass @ speed / model.parameters.dynamic_scale

    state, energies = pulled, [total(pulled)]
    for _ in range(12):
        state = step(model, state, still, 1 / 48, rounds=40, tolerance=1e-6)
        energies.append(total(state))
    assert (np.diff(energies) < 0).all() and energies[-1] < 0.05 * energies[0]


def test_one_mass_alone_follows_the_scheme_by_hand(model):
    """In one step from rest, the two stages of Alexander's scheme for every node together: what they add to the momentum
    is the impulse of gravity less that of all forces met, with the weights 1 - gamma and gamma."""
    dt = 1e-5  # so short that springs have not answered
    lifted = act(model, gravity=np.zeros(3))
    state = step(model, rest_state(model), lifted, dt, rounds=40, tolerance=1e-12)
    free = model.cache["matrix"]["free"]
    speed = state.velocities[free]
    assert speed[:, 2] == pytest.approx(np.full(len(free), 9806.65 * dt), rel=0.02)
    assert np.abs(speed[:, :2]).max() < 0.02 * 9806.65 * dt
    assert 2 * GAMMA * (1 - GAMMA) + GAMMA**2 == pytest.approx(0.5)  # and so they fall by half of g t²
    fallen = (state.positions - model.layers.nodes)[free, 2]
    assert fallen == pytest.approx(np.full(len(free), 0.5 * 9806.65 * dt**2), rel=0.02)


def test_a_fall_ends_at_the_static_sag(model):
    asked = act(model, gravity=np.array([9806.65, 0, 0]))
    target = solve(model, asked, max_iterations=200, tolerance=1e-4).state
    state, memory = rest_state(model), Memory()
    for _ in range(40):
        state = step(model, state, asked, 1 / 24, memory=memory, rounds=4)
    assert np.abs(state.skin - target.skin).max() < 2e-3
    assert np.abs(target.skin - model.layers.nodes[: model.count]).max() > 0.05


def test_few_rounds_with_memory_are_near_the_converged_step(model):
    """A smile that comes and goes while the patch is shaken: 1/24 s frames, and a thousandfold stiffness too."""
    for factor in (1.0, 1000.0):
        scaled = replace(model.parameters, dynamic_scale=factor * model.parameters.dynamic_scale)
        stiff = replace(model, parameters=scaled, cache={"matrix": model.cache["matrix"]})
        ways = {}
        for name, limits in (("few", {"rounds": 4, "tolerance": 0.02}), ("all", {"rounds": 80, "tolerance": 1e-5})):
            state, memory, before, path = rest_state(stiff), Memory(), control(stiff, Pose()), []
            for k in range(1, 13):
                asked = control(stiff, Pose({NAME: 0.5 - 0.5 * np.cos(k / 2)}))
                shaken = Surroundings(acceleration=8000 * np.sin([k, 0.7 * k, 0.4 * k]))
                asked = replace(asked, around=shaken)
                state = step(stiff, state, asked, 1 / 24, before=before, memory=memory, **limits)
                before = asked
                path.append(state.skin)
            ways[name] = np.array(path)
        off = np.linalg.norm(ways["few"] - ways["all"], axis=2)
        assert np.sqrt((off**2).mean()) < 0.04, factor
        assert np.linalg.norm(ways["all"] - model.layers.nodes[: model.count], axis=2).max() > 3


def test_lying_down_the_face_sags_back_and_upside_down_up(reference_model):
    """Gravity as lying on the back feels it points to the back of the head (+Y), and upside down to its top."""
    n = reference_model.count
    rest = reference_model.layers.nodes[:n]
    for gravity, axis in ((np.array([0, 9806.65, 0]), 1), (np.array([0, 0, 9806.65]), 2)):
        solution = solve(reference_model, act(reference_model, gravity=gravity))
        assert solution.converged and solution.diagnostics["inverted_prisms"] == 0
        moved = solution.state.skin - rest
        assert 0.8 < solution.diagnostics["peak_mm"] < 12
        assert moved[:, axis].mean() > 0.02
