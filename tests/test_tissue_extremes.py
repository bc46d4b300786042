# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever is asked, the face bears it: muscles at random with the jaw anywhere come to rest, whole and in place."""

import numpy as np
import pytest

from headshop.sim.acting.pose import control
from headshop.sim.acting.random_poses import random_pose
from headshop.sim.tissue.curvature import Curvature
from headshop.sim.tissue.energy import find_contacts, pose_of
from headshop.sim.tissue.forces import Landscape
from headshop.sim.tissue.solver import descend, factorised, solve

SEED, POSES = 20, 8


@pytest.fixture(scope="module")
def asked(reference_model):
    rng = np.random.default_rng(SEED)
    return [control(reference_model, random_pose(reference_model.muscle_names, rng)) for _ in range(POSES)]


def test_poses_reach_everything(asked):
    jaw = np.array([one.jaw for one in asked])
    assert jaw[:, 0].max() > 0.8 and jaw[:, 0].min() < 0.05 and np.ptp(jaw[:, 1:], axis=0).min() > 0.8
    used = [(one.activations > 0).mean() for one in asked]
    assert max(used) == 1.0 and min(used) < 0.3


def test_random_poses_come_to_rest_whole(reference_model, asked):
    inverted = []
    for one in asked:
        solution = solve(reference_model, one, max_iterations=200)
        report = solution.diagnostics
        off = solution.state.positions - pose_of(reference_model, one).reference
        assert np.isfinite(off).all() and np.linalg.norm(off, axis=1).max() < 35
        assert solution.residual < 0.1 and abs(report["volume_drift"]) < 0.08
        inverted.append(report["inverted_prisms"])
    inverted = np.array(inverted) / len(reference_model.prisms)
    assert inverted.max() < 0.006 and np.median(inverted) < 0.002


def test_every_step_lowers_the_energy(reference_model, asked):
    one = asked[np.argmax([a.activations.sum() for a in asked])]
    pose = pose_of(reference_model, one)
    at = Landscape(reference_model, pose, find_contacts(reference_model, pose, pose.reference))
    energies = []

    def value(q):
        energy, gradient = at(q)
        energies.append(energy)
        return energy, gradient

    q, curvature, reached = at.free(pose.reference), Curvature(), []
    for _ in range(20):
        q, energy, _, _ = descend(value, factorised(reference_model), q, curvature, 1)
        reached.append(energy)
    assert energies[0] > reached[0] and (np.diff(reached) <= 1e-9).all()
