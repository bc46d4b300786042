# SPDX-License-Identifier: GPL-3.0-or-later
"""The tissue follows a moving control frame by frame: near the converged pose, exact at rest, the same every time."""

import numpy as np
import pytest

from headshop.sim.acting.expressions import expressions
from headshop.sim.acting.performance import Performance
from headshop.sim.acting.pose import Pose, control
from headshop.sim.tissue.frames import Frames
from headshop.sim.tissue.solver import solve

FPS = 60.0


@pytest.fixture(scope="module")
def laugh(reference_model):
    """Controls of a fifth of a second: into a smile with a blink, and the jaw falling open 20 degrees a second."""
    smile = {name: ((0.0, 0.0), (0.5, value)) for name, value in expressions()["smile"].muscles.items()}
    keys = {"jaw_open": ((0.0, 0.0), (0.05, 0.0), (0.25, 0.4)), "blink_l": ((0.0, 0.0), (0.15, 1.0))}
    acted = Performance(smile | keys, FPS)
    return [control(reference_model, acted.pose(k / FPS)) for k in range(12)]


def _apart(one, other):
    return np.sqrt(((one.skin - other.skin) ** 2).sum(axis=1).mean())


def test_frames_stay_near_the_converged_pose(reference_model, laugh):
    frames, state = Frames(reference_model), None
    errors = []
    for asked in laugh:
        state = solve(reference_model, asked, state, max_iterations=200, tolerance=2e-3).state
        errors.append(_apart(frames.follow(asked), state))
    assert np.median(errors) < 0.04 and max(errors) < 0.08


def test_a_control_that_stays_is_brought_to_rest(reference_model, laugh):
    frames = Frames(reference_model)
    for _ in range(12):
        frames.follow(laugh[-1], 6, 0.005)
    assert frames.converged and frames.iterations <= 2
    assert _apart(frames.state, solve(reference_model, laugh[-1], max_iterations=200, tolerance=2e-3).state) < 0.05


def test_rest_is_followed_exactly(reference_model, reference):
    frames = Frames(reference_model)
    for _ in range(2):
        assert np.abs(frames.follow(control(reference_model, Pose())).skin - reference.skin.vertices).max() < 1e-9
    assert frames.converged and frames.residual < 1e-9


def test_the_same_calls_give_the_same_bytes(reference_model, laugh):
    first, second = Frames(reference_model), Frames(reference_model)
    for asked in laugh[::4]:
        assert first.follow(asked).positions.tobytes() == second.follow(asked).positions.tobytes()


def test_a_control_that_jumps_does_not_throw_the_skin(reference_model):
    frames = Frames(reference_model)
    poses = [expressions()[name] for name in ("joy", "anger", "pucker", "surprise")]
    for pose in [*poses, Pose(jaw_open=1.0), Pose(), *poses[::-1]]:
        moved = (
            frames.follow(control(reference_model, pose)).skin - reference_model.layers.nodes[: reference_model.count]
        )
        assert np.linalg.norm(moved, axis=1).max() < 60
