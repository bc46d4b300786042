# SPDX-License-Identifier: GPL-3.0-or-later
"""The face of 1995 on the reference head: layers after its tissue's depth, cheeks blown up, both sides alike."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.acting.pose import Pose, control
from headshop.sim.anatomy.tissue_depth import skin_counterparts, table
from headshop.sim.tissue.layers import build_layers
from headshop.sim.tissue.lee1995.depth import depth_range, layered
from headshop.sim.tissue.lee1995.model import build_model
from headshop.sim.tissue.lee1995.solver import solve
from headshop.sim.tissue.parameters import DEFAULT


@pytest.fixture(scope="module")
def model(reference):
    return build_model(reference)


@pytest.fixture(scope="module")
def blown(model):
    return solve(model, replace(control(model, Pose()), cheeks=1.0), max_iterations=30)


def _depths(head):
    layers = layered(head)
    n = len(layers.area)
    return layers, np.linalg.norm(layers.nodes[2 * n :] - layers.nodes[:n], axis=1)


def test_layers_are_as_deep_as_the_tissue(reference):
    layers, depth = _depths(reference)
    marks = skin_counterparts(reference.landmark_positions())
    near = cKDTree(reference.skin.vertices)
    for name in ("g", "n", "rhi", "pg", "ft_l", "zy_r", "os_l"):
        column = near.query(marks[name])[1]
        expected = table()[name.removesuffix("_l").removesuffix("_r")]
        assert abs(depth[column] - expected.mean) < 3 * expected.sd, name
    least, most = depth_range(reference)
    assert (depth > least - 1e-9)[layers.bony].all() and (depth < most + 1e-9)[layers.bony].all()
    assert np.percentile(depth[layers.bony], 95) > 2 * np.percentile(depth[layers.bony], 5)


def test_implausible_bone_is_not_believed(reference):
    skull = reference.parts["skull"]
    sunk = reference.with_vertices({"skull": skull.vertices * 0.9})
    layers, depth = _depths(sunk)
    _, most = depth_range(sunk)
    nodes = build_layers(sunk, DEFAULT).nodes.reshape(3, -1, 3)
    assert (np.linalg.norm(nodes[2] - nodes[0], axis=1) > most + 1)[layers.bony].sum() > 50
    assert (depth <= most + 1e-9)[layers.bony].all()


def test_cheeks_go_out_and_nothing_else(model, blown, reference):
    moved = blown.state.skin - reference.skin.vertices
    for side, sign in (("l", 1), ("r", -1)):
        cheek = np.asarray(reference.groups[f"cheek_{side}"])
        middle = np.argmax(cheek * (sign * moved[:, 0]))
        assert 4 < sign * moved[middle, 0] < 16
    assert np.linalg.norm(moved[np.asarray(reference.groups["forehead"]) > 0.5], axis=1).max() < 0.5
    assert blown.diagnostics["penetration_mm"] < 0.1 and blown.diagnostics["inverted_prisms"] < 10


def test_both_sides_move_alike(blown, reference):
    rest = reference.skin.vertices
    away, mirror = cKDTree(rest).query(rest * [-1, 1, 1])
    pairs = away < 1e-3
    moved = blown.state.skin - rest
    assert pairs.mean() > 0.9
    assert np.abs(moved[mirror] * [-1, 1, 1] - moved)[pairs].max() < 0.1


def test_a_pose_taken_up_again_stays(model, blown):
    again = solve(model, replace(control(model, Pose()), cheeks=1.0), blown.state, max_iterations=3)
    assert np.abs(again.state.skin - blown.state.skin).max() < 1.0
