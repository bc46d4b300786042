# SPDX-License-Identifier: GPL-3.0-or-later
"""What a head that moves through a room makes its face feel; gusts; the channels of a performance that say so."""

import numpy as np
import pytest

from headshop.sim.acting.head_motion import HeadMotion, felt, rotation, standing
from headshop.sim.acting.outer import OUTER, head_motion, surroundings
from headshop.sim.acting.performance import Performance, performance_from, read_performance, write_performance
from headshop.sim.acting.turbulence import Turbulence, gusty
from headshop.sim.errors import InputError
from headshop.sim.tissue.surroundings import STANDARD_GRAVITY, apparent_acceleration

G = 9806.65


def test_turn_nod_and_tilt_lead_where_they_say():
    face, top, left = np.array([0, -1.0, 0]), np.array([0, 0, 1.0]), np.array([1.0, 0, 0])
    assert (rotation(0.3, 0, 0) @ face) @ left == pytest.approx(np.sin(0.3))  # looks to its left
    assert (rotation(0, 0.3, 0) @ face)[2] == pytest.approx(-np.sin(0.3))  # looks down
    assert (rotation(0, 0, 0.3) @ top) @ left == pytest.approx(np.sin(0.3))  # to the left shoulder
    both = rotation(0.4, 0.5, 0)  # a turned head nods about its own axis between the ears
    assert both @ left == pytest.approx([np.cos(0.4), np.sin(0.4), 0])


def test_a_standing_head_feels_nothing_and_a_lying_one_its_weight():
    assert all(frame.idle for frame in felt(standing(3, 24.0)))
    lying = HeadMotion(np.tile(rotation(0, -np.pi / 2, 0), (2, 1, 1)), np.zeros((2, 3)), 24.0)
    for frame in felt(lying):
        assert frame.gravity == pytest.approx([0, G, 0], abs=1e-6)  # to the back of the head
        assert not frame.acceleration.any() and not frame.spin.any()


def test_differences_of_a_path_are_its_derivatives():
    """A head carried round a circle while it turns about an axis: compared with the analytic motion."""
    fps = 400.0
    t = np.arange(60) / fps
    positions = 30 * np.stack([np.cos(5 * t), np.sin(5 * t), 0 * t], axis=1)
    turn = 0.8 * np.sin(4 * t)
    motion = HeadMotion(np.array([rotation(a, 0, 0) for a in turn]), positions, fps)
    frames = felt(motion)
    for k in (10, 30, 50):
        inward = rotation(turn[k], 0, 0).T
        assert frames[k].acceleration == pytest.approx(inward @ (-25 * positions[k]), rel=1e-3, abs=0.5)
        assert frames[k].spin == pytest.approx([0, 0, 3.2 * np.cos(4 * t[k])], rel=1e-3, abs=1e-3)
        assert frames[k].spin_rate == pytest.approx([0, 0, -12.8 * np.sin(4 * t[k])], rel=1e-3, abs=1e-2)
    still = felt(motion, moving=False)
    assert not still[30].acceleration.any() and still[30].gravity == pytest.approx(STANDARD_GRAVITY)


def test_free_fall_in_a_room_is_weightless_and_the_wind_of_falling_blows_from_below():
    fps = 120.0
    t = np.arange(24) / fps
    falling = HeadMotion(np.tile(rotation(0.3, 0.2, 0.1), (24, 1, 1)), np.outer(t * t / 2, STANDARD_GRAVITY), fps)
    frame = felt(falling, wind=np.zeros((24, 3)))[12]
    nothing = apparent_acceleration(frame, np.zeros((1, 3))) + STANDARD_GRAVITY
    assert np.abs(nothing).max() < 1e-3 * G
    up = rotation(0.3, 0.2, 0.1).T @ [0, 0, G * t[12]]
    assert frame.wind == pytest.approx(up, rel=1e-3)


def test_gusts_are_the_same_for_a_seed_and_neither_make_nor_lose_air():
    points = np.random.default_rng(0).uniform(-80, 80, (50, 3))
    wind, times = np.tile([0.0, 5000.0, 0.0], (40, 1)), np.arange(40) / 24
    one = gusty(wind, np.full(40, 0.2), points, times, seed=3)
    np.testing.assert_array_equal(one, gusty(wind, np.full(40, 0.2), points, times, seed=3))
    assert np.abs(one - gusty(wind, np.full(40, 0.2), points, times, seed=4)).max() > 100
    np.testing.assert_array_equal(gusty(wind, np.zeros(40), points, times), np.broadcast_to(wind[:, None], one.shape))
    fields = [Turbulence(np.random.default_rng(seed)) for seed in range(60)]
    drawn = np.array([field.at(points, 0.7) for field in fields])
    assert drawn.std() == pytest.approx(1.0, rel=0.1)
    h = 1e-3
    out = sum(
        (fields[0].at(points + h * e, 0.0) - fields[0].at(points - h * e, 0.0))[:, k] for k, e in enumerate(np.eye(3))
    )
    assert np.abs(out).max() / (2 * h) < 1e-6


def test_channels_of_the_room_in_a_performance(tmp_path):
    keys = {"jaw_open": ((0.0, 0.0), (0.5, 1.0)), "head_nod": ((0.0, 0.0), (0.5, 0.4)), "wind_y": ((0.0, 9000.0),)}
    acted = Performance({**keys, "wind_turbulence": ((0.0, 0.3),)}, 24.0, "nod", 5)
    path = tmp_path / "nod.json"
    write_performance(path, acted)
    assert read_performance(path) == acted
    assert not set(acted.pose(0.5).muscles) & set(OUTER) and acted.pose(0.5).jaw_open == 1
    motion = head_motion(acted)
    assert len(motion) == acted.frame_count and not motion.still
    assert motion.rotations[-1] == pytest.approx(rotation(0, 0.4, 0))
    points = np.array([[0.0, -90, 0], [60, 0, 0]])
    frames = surroundings(acted, points)
    assert frames[6].wind.shape == (2, 3) and frames[6].spin[0] > 0.5
    steady = surroundings(acted, points, moving=False)
    assert steady[0].wind == pytest.approx([0, 9000, 0]) and not steady[6].spin.any()
    assert steady[-1].gravity[1] == pytest.approx(-G * np.sin(0.4))  # the face looks down: towards it
    assert all(f.idle for f in surroundings(Performance({"jaw_open": keys["jaw_open"]}), points))


def test_a_seed_is_a_whole_number():
    document = {"format": "headshop-performance/1", "channels": {"wind_y": [[0, 1]]}}
    with pytest.raises(InputError, match="seed"):
        performance_from(document | {"seed": -1})
    assert performance_from(document | {"seed": 7}).seed == 7
