# SPDX-License-Identifier: GPL-3.0-or-later
"""The face follows its sliders: dragged, keyed, undone, saved, switched off."""

from dataclasses import replace

import numpy as np
import pytest


@pytest.fixture
def skin(addon, reference, reference_model, monkeypatch):
    """The skin of a head made of the reference; its tissue is built once for all tests."""
    from headshop.headshop_addon import heads
    from headshop.sim.tissue import model

    def build_model(head):
        same = np.allclose(head.skin.vertices, reference.skin.vertices, atol=1e-3)
        return replace(reference_model) if same else build(head)

    build = model.build_model
    monkeypatch.setattr(model, "build_model", build_model)
    heads.create_head(reference, "Ref")
    return heads.find_heads()[0]


def live_delta(skin) -> np.ndarray:
    """(n, 3) mm that the live pose moves the skin."""
    from headshop.headshop_addon import bridge, following

    keys = skin.data.shape_keys
    if keys is None or following.KEY not in keys.key_blocks:
        return np.zeros((len(skin.data.vertices), 3))
    return bridge.read_positions(skin, following.KEY) - bridge.read_positions(skin)


def peak(skin) -> float:
    """Largest motion, mm."""
    return float(np.linalg.norm(live_delta(skin), axis=1).max())


def test_a_slider_moves_the_face_and_zero_is_rest_exactly(skin):
    skin.headshop.muscles.zygomaticus_major_l = 0.8
    moved = live_delta(skin)
    assert 2.0 < np.linalg.norm(moved, axis=1).max() < 25.0
    assert skin.data.shape_keys.key_blocks["Live"].value == 1.0
    farthest = skin.data.vertices[int(np.linalg.norm(moved, axis=1).argmax())].co
    assert farthest.x > 0, "the subject's left is +X"
    skin.headshop.muscles.zygomaticus_major_l = 0.0
    assert peak(skin) == 0.0


def test_the_live_pose_is_the_baked_pose(skin, addon):
    from headshop.headshop_addon import bridge, shape_keys
    from headshop.sim.acting.pose import Pose
    from headshop.sim.progress import finish

    skin.headshop.muscles.zygomaticus_major_l = 0.8
    live = live_delta(skin)
    finish(shape_keys.bake_poses(skin, {"smile": Pose({"zygomaticus_major_l": 0.8})}))
    baked = bridge.read_positions(skin, "smile") - bridge.read_positions(skin)
    assert np.linalg.norm(live - baked, axis=1).max() < 0.3


def test_the_jaw_takes_mandible_teeth_and_tongue_along_and_leaves_the_skull(skin):
    from headshop.headshop_addon import heads

    skin.headshop.controls.jaw_open = 0.5
    moving = {
        part
        for part, obj in heads.parts_of(skin).items()
        if obj.data.shape_keys and "Live" in obj.data.shape_keys.key_blocks
    }
    assert moving == {"skin", "mandible", "teeth_lower", "tongue"}


def test_switched_off_nothing_is_left_and_nothing_follows(skin):
    skin.headshop.muscles.corrugator_l = 1.0
    assert peak(skin) > 0.1
    skin.headshop.live = False
    assert skin.data.shape_keys is None
    skin.headshop.muscles.corrugator_l = 0.5
    assert skin.data.shape_keys is None
    skin.headshop.live = True
    assert peak(skin) > 0.1


def test_the_artists_own_shape_keys_stay(skin):
    skin.shape_key_add(name="Basis")
    skin.shape_key_add(name="My Wrinkle")
    skin.headshop.muscles.corrugator_l = 1.0
    skin.headshop.live = False
    assert [key.name for key in skin.data.shape_keys.key_blocks] == ["Basis", "My Wrinkle"]


def test_the_face_follows_keyed_sliders_along_the_time_line(skin, addon):
    scene = addon.context.scene
    for frame, value in ((1, 0.0), (11, 1.0)):
        skin.headshop.muscles.corrugator_l = value
        skin.keyframe_insert("headshop.muscles.corrugator_l", frame=frame)
    peaks = []
    for frame in (1, 6, 11):
        scene.frame_set(frame)
        peaks.append(peak(skin))
    assert peaks[0] == 0.0 and 0.05 < peaks[1] < peaks[2]


def test_setting_many_sliders_solves_once(skin, addon, monkeypatch):
    from headshop.headshop_addon import following

    calls = []
    pose = following.pose
    monkeypatch.setattr(following, "pose", lambda *arguments: calls.append(1) or pose(*arguments))
    addon.ops.headshop.set_expression(expression="joy", amount=0.4)
    assert len(calls) == 1


def test_a_changed_rest_shape_is_simulated_anew(skin):
    """The cache may never speak of a head that is no longer there."""
    from headshop.headshop_addon import bridge, following

    skin.headshop.muscles.corrugator_l = 1.0
    before = following.kept[skin.session_uid].model
    bridge.write_positions(skin, bridge.read_positions(skin) * 1.1)
    skin.headshop.muscles.corrugator_l = 0.9
    assert following.kept[skin.session_uid].model is not before


def test_undo_takes_the_face_back_with_the_slider(skin, addon):
    from headshop.headshop_addon import heads

    addon.ops.ed.undo_push(message="rest")
    skin.headshop.muscles.corrugator_l = 1.0
    addon.ops.ed.undo_push(message="pulled")
    addon.ops.ed.undo()
    skin = heads.find_heads()[0]
    assert skin.headshop.muscles.corrugator_l == 0.0 and peak(skin) == 0.0
    addon.ops.ed.redo()
    skin = heads.find_heads()[0]
    assert skin.headshop.muscles.corrugator_l == 1.0 and peak(skin) > 0.1


def test_a_saved_head_is_loaded_in_its_pose_and_can_be_posed_and_baked_again(skin, addon, tmp_path):
    from headshop.headshop_addon import heads, shape_keys
    from headshop.sim.acting.pose import Pose
    from headshop.sim.mesh_subdivision import drawn
    from headshop.sim.progress import finish

    skin.headshop.muscles.corrugator_l = 1.0
    moved = live_delta(skin)
    addon.ops.wm.save_as_mainfile(filepath=str(tmp_path / "head.blend"))
    addon.ops.wm.open_mainfile(filepath=str(tmp_path / "head.blend"))
    skin = heads.find_heads()[0]
    assert live_delta(skin) == pytest.approx(moved, abs=1e-4)
    skin.headshop.muscles.corrugator_l = 0.5
    assert 0.05 < peak(skin) < np.linalg.norm(moved, axis=1).max()
    report = finish(shape_keys.bake_poses(skin, {"pull": Pose({"corrugator_l": 1.0})}))
    seen = drawn(heads.read_head(skin).skin.faces, moved)
    assert report["pull"]["peak_mm"] == pytest.approx(np.linalg.norm(seen, axis=1).max(), abs=0.2)


def test_a_broken_head_says_so_and_does_not_fail(skin, addon, capfd):
    from headshop.headshop_addon import heads

    addon.data.objects.remove(heads.parts_of(skin)["mandible"])
    skin.headshop.muscles.corrugator_l = 1.0
    assert "mandible" in capfd.readouterr().out


def test_other_objects_have_sliders_that_do_nothing(addon):
    obj = addon.data.objects.new("Lamp", None)
    obj.headshop.muscles.corrugator_l = 1.0
    obj.headshop.live = False


def test_the_other_model_takes_over_and_hands_back(skin):
    from headshop.headshop_addon import following

    skin.headshop.muscles.zygomaticus_major_l = 0.8
    simulated = live_delta(skin)
    skin.headshop.model = "DIRECT"
    direct = live_delta(skin)
    assert following.kept[skin.session_uid].acting.name == "waters" and following.kept[skin.session_uid].settled
    assert 5 < np.linalg.norm(direct, axis=1).max() < 12 and np.abs(direct - simulated).max() > 1
    skin.headshop.muscles.zygomaticus_major_l = 0.0
    assert peak(skin) == 0.0
    skin.headshop.model = "SIMULATED"
    skin.headshop.muscles.zygomaticus_major_l = 0.8
    assert live_delta(skin) == pytest.approx(simulated, abs=0.05)
