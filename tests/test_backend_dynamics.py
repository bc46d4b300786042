# SPDX-License-Identifier: GPL-3.0-or-later
"""A performance baked with dynamics: the head's motion from a file and from the scene, and what is left of it."""

import numpy as np
import pytest

from headshop.sim.acting.performance import Performance
from headshop.sim.errors import InputError
from headshop.sim.progress import finish


@pytest.fixture
def skin(addon, reference, reference_model, monkeypatch):
    from headshop.headshop_addon import heads
    from headshop.sim.tissue import model

    monkeypatch.setattr(model, "build_model", lambda head: reference_model)
    heads.create_head(reference, "Fran")
    return heads.find_heads()[0]


SHAKE = {
    "jaw_open": ((0.0, 0.0), (0.2, 0.01)),
    "head_z": ((0.0, 0.0), (0.08, 40.0), (0.16, 0.0)),
    "head_turn": ((0.0, 0.0), (0.1, 0.3), (0.2, 0.0)),
}


def test_flesh_swings_with_the_head_and_the_head_moves(addon, skin):
    from headshop.headshop_addon import baking, performance

    acted = Performance(SHAKE, 25.0)
    report = finish(baking.bake(skin, None, acted, dynamics=True))["performance"]
    assert report["dynamics"] and report["frames"] == 6 and report["converged"] == 6
    swung = report["peak_mm"]
    scene = addon.context.scene
    scene.frame_set(3)
    assert skin.matrix_world.translation.z == pytest.approx(0.040, abs=1e-3)
    assert skin.matrix_world.to_euler().z == pytest.approx(acted.value("head_turn", 0.08), abs=1e-4)
    report = finish(baking.bake(skin, None, acted))["performance"]  # again, without
    assert not report["dynamics"] and report["peak_mm"] < swung - 0.3
    assert [skin.animation_data.action is not None, len(addon.data.actions)] == [True, 2]
    performance.remove_performance(skin)
    assert skin.animation_data.action is None and len(addon.data.actions) == 0
    scene.frame_set(3)
    assert np.abs(np.array(skin.matrix_world) - np.eye(4)).max() < 1e-6


def test_the_operator_takes_the_motion_of_the_object(addon, skin):
    """Sliders keyed at rest, the object thrown up and turned on its side: the face sags to that side and more."""
    scene = addon.context.scene
    scene.frame_start, scene.frame_end, scene.render.fps = 1, 5, 24
    for frame, height in ((1, 0.0), (3, 0.05), (5, 0.0)):
        skin.location.z = height
        skin.keyframe_insert("location", frame=frame)
        skin.keyframe_insert("headshop.controls.jaw_open", frame=frame)
    from headshop.headshop_addon.head_place import felt_in, read_motion

    motion = read_motion(skin, scene, range(1, 6))
    assert motion.positions[2] == pytest.approx([0, 0, 50], abs=1e-3) and motion.fps == 24
    skin.headshop.wind, skin.headshop.turbulence = (0, 10, 0), 0.2
    frames = felt_in(skin, scene, range(1, 6))(np.zeros((4, 3)))
    assert frames[2].acceleration[2] < -9000 and frames[2].wind.shape == (4, 3)
    skin.headshop.wind = (0, 0, 0)
    keys = skin.data.shape_keys
    assert addon.ops.headshop.bake_performance(dynamics=True) == {"FINISHED"}
    keys = skin.data.shape_keys
    assert keys is not None and len(keys.key_blocks) > 1
    scene.frame_set(3)
    assert skin.matrix_world.translation.z == pytest.approx(0.05, abs=1e-4)  # the artist's own keys stay
    assert not skin.headshop.live
    assert addon.ops.headshop.remove_baked() == {"FINISHED"}
    assert skin.data.shape_keys is None and skin.headshop.live
    assert skin.matrix_world.translation.z == pytest.approx(0.05, abs=1e-4)
    assert not addon.ops.headshop.remove_baked.poll()


def test_only_what_moves_bakes_with_dynamics(skin):
    from headshop.headshop_addon import baking

    with pytest.raises(InputError, match="dynamics"):
        finish(baking.bake(skin, None, Performance(SHAKE), "lee", True))
