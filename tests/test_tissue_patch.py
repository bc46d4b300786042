# SPDX-License-Identifier: GPL-3.0-or-later
"""Lee, Terzopoulos and Waters 1995, figure 9: a flat patch of layered tissue over flat bone with one muscle."""

from dataclasses import replace

import numpy as np
import pytest

from headshop.sim.acting.pose import Pose, control
from headshop.sim.errors import InputError
from headshop.sim.tissue import contact, planes
from headshop.sim.tissue.dynamics import step
from headshop.sim.tissue.energy import find_contacts, pose_of
from headshop.sim.tissue.forces import energy_gradient
from headshop.sim.tissue.kaehler2002.parameters import DEFAULT as KAEHLER
from headshop.sim.tissue.lee1995.constants import DEFAULT as LEE
from headshop.sim.tissue.model import build_model
from headshop.sim.tissue.parameters import DEFAULT
from headshop.sim.tissue.solver import rest_state, solve

NAME = "zygomaticus_major_l"
TABLE = {"zygomaticus_major": {"excursion_mm": 8.0}}


@pytest.fixture(scope="module")
def patch(flat_patch):
    return flat_patch(17, 96.0)


@pytest.fixture(scope="module")
def model(patch):
    return build_model(patch, table=TABLE)


@pytest.fixture(scope="module")
def pulled(model):
    return solve(model, control(model, Pose({NAME: 1.0})))


def test_rest_is_rest(model):
    solution = solve(model, control(model, Pose()))
    assert solution.converged and solution.residual < 1e-9
    assert np.abs(solution.state.positions - model.layers.nodes).max() < 1e-9


def test_gradient_is_the_derivative_of_the_energy(model):
    rng = np.random.default_rng(3)
    pose = pose_of(model, control(model, Pose({NAME: 0.6})))
    free = model.cache["matrix"]["free"]
    x = pose.reference.copy()
    x[free] += rng.normal(0, 0.8, (len(free), 3))
    planes = find_contacts(model, pose, x)
    _, gradient = energy_gradient(model, pose, planes, x)
    for _ in range(4):
        way = rng.normal(0, 1, (len(free), 3))
        energies = []
        for h in (-1e-5, 1e-5):
            y = x.copy()
            y[free] += h * way
            energies.append(energy_gradient(model, pose, planes, y)[0])
        assert (energies[1] - energies[0]) / 2e-5 == pytest.approx((gradient * way).sum(), rel=1e-4)


def test_muscle_moves_skin_toward_its_root(model, pulled):
    assert pulled.converged and pulled.diagnostics["inverted_prisms"] == 0
    moved = pulled.state.skin - model.layers.nodes[: model.count]
    peak = np.argmax(np.linalg.norm(moved, axis=1))
    assert moved[peak, 0] < -4 and abs(moved[peak, 1]) < 0.5
    assert 0 < model.layers.nodes[peak, 0] <= 25  # near the free end, not at the root


def test_skin_bulges_at_the_root_and_dips_at_the_end(model, pulled):
    """3.6: near the origin of the fibre the skin bulges out, near the end it is depressed."""
    x = model.layers.nodes[: model.count]
    middle = np.abs(x[:, 1]) < 1
    height = pulled.state.skin[middle, 2]
    where = x[middle, 0]
    assert height[where < -12].max() > 0.2
    assert height[(where > 5) & (where < 30)].min() < -0.2


def test_activation_is_monotone_and_saturates(model):
    state, peaks = None, []
    for a in (0.25, 0.5, 0.75, 1.0):
        solution = solve(model, control(model, Pose({NAME: a})), state)
        state = solution.state
        peaks.append(solution.diagnostics["peak_mm"])
    steps = np.diff([0, *peaks])
    assert (steps > 0).all() and (np.diff(steps) < 0).all()
    assert peaks[-1] < model.muscles.reach[0]


def test_solution_does_not_depend_on_the_start(model, pulled):
    other = solve(model, control(model, Pose({NAME: 0.3}))).state
    again = solve(model, control(model, Pose({NAME: 1.0})), other)
    assert np.abs(again.state.skin - pulled.state.skin).max() < 0.1


def test_mirror_symmetry(model, pulled):
    x = model.layers.nodes[: model.count]
    order = np.lexsort((x[:, 1], x[:, 0])), np.lexsort((-x[:, 1], x[:, 0]))
    a, b = pulled.state.skin[order[0]], pulled.state.skin[order[1]]
    assert np.abs(a - b * [1, -1, 1]).max() < 0.1


@pytest.mark.parametrize("dt", [1e-3, 0.04, 10.0])
def test_step_is_stable_and_ends_at_the_solution(model, pulled, dt):
    state = rest_state(model)
    asked = control(model, Pose({NAME: 1.0}))
    for _ in range(25):
        state = step(model, state, asked, dt)
        moved = np.abs(state.skin - model.layers.nodes[: model.count]).max()
        assert moved < 2.5 * pulled.diagnostics["peak_mm"]  # let go it swings to twice, where it is light farther
    if dt > 0.01:
        assert np.abs(state.skin - pulled.state.skin).max() < 0.2


def test_fascia_slides_on_bone_and_never_enters(model):
    """3.7: the force into the bone is cancelled, motion along it is free."""
    pose = pose_of(model, control(model, Pose()))
    x = pose.reference.copy()
    n = model.count
    node = n + np.argmin(np.abs(x[n : 2 * n, :2]).sum(axis=1))
    x[node] += [2.0, 0, 0]
    bone = contact.bone_planes(model.contacts.bones, model.layers, x[n : 2 * n], np.eye(3), np.zeros(3))
    assert planes.depths(bone, x).max() == 0
    x[node] += [0, 0, -6.0]
    energy, gradient = planes.contact_energy(bone, x, 10.0)
    assert energy > 0 and gradient[node, 2] < 0 and np.abs(gradient[node, :2]).max() < 1e-12
    out = planes.project(bone, x)
    assert planes.depths(bone, out).max() < 1e-9 and out[node, 0] == x[node, 0]


@pytest.mark.parametrize("value", [-60.0, float("nan"), "hard", None])
def test_parameters_that_are_none_are_refused(value):
    """A model was made of them, and rested nowhere."""
    for constants, name in ((DEFAULT, "epidermis"), (LEE, "fascia"), (KAEHLER, "skin")):
        with pytest.raises(InputError, match=f"has {name}"):
            replace(constants, **{name: value})
    assert replace(DEFAULT, epidermis=np.float32(50)).epidermis == 50
