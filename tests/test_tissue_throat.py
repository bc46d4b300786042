# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin under the chin of a wide open mouth: it goes down with the floor of the mouth, and has one place to rest."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from headshop.sim.acting.pose import Pose, control
from headshop.sim.anatomy.inside import inside
from headshop.sim.mesh_subdivision import smoother
from headshop.sim.tissue.energy import pose_of
from headshop.sim.tissue.solver import solve
from headshop.sim.tissue.throat import build_throat


@pytest.fixture(scope="module")
def widest(reference_model):
    asked = control(reference_model, Pose(jaw_open=1.0))
    return pose_of(reference_model, asked), solve(reference_model, asked, max_iterations=300, tolerance=2e-3)


def test_only_what_goes_half_with_the_jaw_and_half_with_the_neck_is_throat():
    jaw, neck = np.array([1.0, 0.5, 0.5, 0.0]), np.array([0.0, 0.0, 0.4, 1.0])  # chin, cheek, throat, neck
    throat = build_throat(jaw, neck, csr_matrix((4, 4)), np.ones(4))
    assert throat.off.tolist() == [0, 0, 1, 1]
    other = [0, 1, 3]
    assert (throat.hold[other] == 0).all() and (throat.sheet[other] == 1).all() and (throat.sink[other] == 0).all()
    assert throat.hold[2] > 1 and throat.sheet[2] < 0.5 and 0.1 < throat.sink[2] < 1


def test_it_goes_down_with_the_mouth_and_bone_stays_bone(reference_model, widest):
    pose, solution = widest
    layers, n = reference_model.layers, reference_model.count
    moved = solution.state.positions - layers.nodes
    deep = layers.sink[:n] > 0.2
    assert deep.sum() > 20 and moved[:n][deep, 2].mean() < -10
    on_jaw = np.flatnonzero(layers.bony & (layers.mandible == 1))
    carried = layers.nodes[2 * n + on_jaw] @ pose.rotation.T + pose.translation
    assert np.allclose(solution.state.positions[2 * n + on_jaw], carried)


@pytest.mark.parametrize("opening", [0.75, 0.9])
def test_it_rests_in_one_place_wherever_it_comes_from(reference_model, widest, opening):
    asked = control(reference_model, Pose(jaw_open=opening))
    moved = control(reference_model, Pose({"platysma_l": 0.6, "mentalis_r": 0.5}, jaw_open=opening))
    scan = solve(reference_model, asked, max_iterations=300, tolerance=2e-3).state.skin
    starts = widest[1].state, solve(reference_model, moved).state
    for start in starts:
        found = solve(reference_model, asked, start, max_iterations=300, tolerance=2e-3).state.skin
        assert np.linalg.norm(found - scan, axis=1).max() < 0.5


def test_the_mandible_stays_under_the_skin(reference, reference_model, widest):
    pose, solution = widest
    rows, quads = smoother(reference.skin.faces, reference_model.count, 1)
    skin = rows @ solution.state.skin
    bone = reference.parts["mandible"].vertices @ pose.rotation.T + pose.translation
    assert inside(bone, skin, np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])).all()
