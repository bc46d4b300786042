# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference head is its own mirror image, so what its left side does is the mirror image of what its right side does."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from headshop.sim.acting.arkit import mirrored
from headshop.sim.acting.pose import Pose, control, pose_from
from headshop.sim.tissue.muscle_field import JAW_MUSCLES, base_name
from headshop.sim.tissue.solver import solve

FLIP = np.array([-1.0, 1.0, 1.0])
GROUPS = 4  # the paired muscles are tried in so many lots, those of a lot at once


@pytest.fixture(scope="module")
def mate(reference_model):
    """(n,) the vertex that is each one's mirror image."""
    skin = reference_model.layers.nodes[: reference_model.count]
    distance, mate = cKDTree(skin).query(skin * FLIP)
    assert distance.max() < 1e-9
    return mate


def _solved(reference_model, channels):
    # to the end: a descent that stops early stops elsewhere on either side by chance of rounding
    asked = control(reference_model, pose_from(channels))
    return solve(reference_model, asked, max_iterations=200, tolerance=2e-3).state.skin


def _farthest(reference_model, mate, channels):
    one, other = _solved(reference_model, channels), _solved(reference_model, mirrored(channels))
    assert np.linalg.norm(one - reference_model.layers.nodes[: reference_model.count], axis=1).max() > 1.0
    return np.linalg.norm(one[mate] * FLIP - other, axis=1).max()


def test_layers_mirror(reference_model, mate):
    """Also where two places of the bone are equally near, as under the edge of the chin."""
    n = reference_model.count
    for nodes in np.split(reference_model.layers.nodes, 3):
        assert nodes[mate] * FLIP == pytest.approx(nodes, abs=1e-6)
    assert (reference_model.layers.bony[mate] == reference_model.layers.bony).all() and len(mate) == n


@pytest.mark.parametrize("lot", range(GROUPS))
def test_left_muscles_do_the_mirror_image_of_the_right_ones(reference_model, mate, lot):
    left = [name for name in reference_model.muscle_names if name.endswith("_l") and base_name(name) not in JAW_MUSCLES]
    assert len(left) > 20
    assert _farthest(reference_model, mate, dict.fromkeys(left[lot::GROUPS], 1.0)) < 0.05


def test_jaw_to_the_side_mirrors(reference_model, mate):
    assert _farthest(reference_model, mate, {"jaw_side": 1.0, "jaw_open": 0.2, "gaze_x": 0.5, "blink_l": 0.7}) < 0.1


def test_what_is_alike_on_both_sides_stays_so(reference_model, mate):
    skin = _solved(reference_model, Pose(jaw_open=0.7).values())
    assert np.linalg.norm(skin[mate] * FLIP - skin, axis=1).max() < 0.05
