# SPDX-License-Identifier: GPL-3.0-or-later
"""A baked performance plays in any Blender: shape keys and one slotted action, nothing of ours running."""

import subprocess
import sys

import numpy as np
import pytest

from headshop.sim.acting.pose import Pose
from headshop.sim.acting.principal import principal_shapes
from headshop.sim.errors import InputError
from headshop.sim.mesh_subdivision import drawn
from headshop.sim.progress import finish

FRAMES = np.arange(1, 13)


@pytest.fixture
def skin(bpy, reference):
    from headshop.headshop_addon import heads

    heads.create_head(reference, "Fran")
    return heads.find_heads()[0]


@pytest.fixture
def performance(bpy):
    from headshop.headshop_addon import performance

    return performance


@pytest.fixture
def motion(reference):
    """Part -> (12, n, 3) mm: sums of three shapes."""
    rng = np.random.default_rng(2)
    return {
        part: np.einsum(
            "fk,kni->fni", rng.normal(size=(12, 3)), rng.normal(size=(3, *reference.parts[part].vertices.shape))
        )
        for part in ("skin", "mandible")
    }


def write(performance, skin, motion):
    performance.write_performance(
        skin, {p: principal_shapes(m, 0.001) for p, m in motion.items()}, FRAMES, "Performance"
    )


def played(bpy, obj, frame):
    """Positions (n, 3) mm of the object's own mesh at a frame, as Blender plays it."""
    for modifier in obj.modifiers:
        modifier.show_viewport = False
    bpy.context.scene.frame_set(frame)
    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    return np.array([vertex.co for vertex in mesh.vertices]) * 1000


def test_it_plays_what_was_simulated(bpy, skin, performance, motion, reference):
    from headshop.headshop_addon import heads

    write(performance, skin, motion)
    for part in motion:
        for frame in (1, 5, 12):
            wanted = reference.parts[part].vertices + motion[part][frame - 1]
            np.testing.assert_allclose(played(bpy, heads.parts_of(skin)[part], frame), wanted, atol=0.002)
    action = bpy.data.actions["Fran Performance"]
    assert [slot.target_id_type for slot in action.slots] == ["KEY", "KEY"]


def exported(skin, folder):
    """Shapes and performance as an export folder holds them."""
    from headshop.headshop_addon.plain_export import write_plain

    write_plain(skin, folder)
    with np.load(folder / "shapes.npz") as shapes, np.load(folder / "performance.npz") as acting:
        return dict(shapes), dict(acting)


def test_plain_files_hold_every_frame(bpy, skin, performance, motion, reference, tmp_path):
    from headshop.headshop_addon import shape_keys

    pose = {"joy": {"skin": np.ones_like(reference.skin.vertices)}}
    write(performance, skin, motion)
    shape_keys.write_shapes(skin, pose, {"joy": {"peak_mm": 1.0}})
    bpy.context.scene.render.fps, bpy.context.scene.render.fps_base = 30, 1.001
    shapes, acting = exported(skin, tmp_path)
    assert acting["names"].tolist() == shapes["names"].tolist() == ["joy", *(f"Performance_{k:02d}" for k in (1, 2, 3))]
    assert acting["fps"] == pytest.approx(30 / 1.001) and acting["frames"].tolist() == FRAMES.tolist()
    assert acting["weights"].shape == (12, 4) and not acting["weights"][:, 0].any()
    frames = shapes["basis"] + np.tensordot(acting["weights"], shapes["deltas"], 1)
    for frame, found in zip(acting["frames"], frames, strict=True):
        wanted = drawn(reference.skin.faces, played(bpy, skin, int(frame)))
        np.testing.assert_allclose(found, wanted, atol=0.002)


def test_plain_files_hold_it_beside_the_artists_own_animation(bpy, skin, performance, motion, tmp_path):
    from headshop.headshop_addon import bridge

    bridge.ensure_shape_key(skin, "sculpted").keyframe_insert("value", frame=1)
    write(performance, skin, motion)
    shapes, acting = exported(skin, tmp_path)
    assert acting["names"].tolist() == [f"Performance_{k:02d}" for k in (1, 2, 3)]
    assert np.abs(acting["weights"]).max(axis=0) == pytest.approx(1)
    performance.remove_performance(skin)
    assert performance.baked_weights(skin) is None


@pytest.mark.parametrize("fps", [0.01, 0.4, 0.5, 23.976, 1000])
def test_a_scene_plays_as_fast_as_the_performance(bpy, fps):
    from headshop.headshop_addon.head_place import frame_rate, set_frame_rate

    set_frame_rate(bpy.context.scene, fps)
    assert frame_rate(bpy.context.scene) == pytest.approx(fps)


def test_baking_again_replaces_it(bpy, skin, performance, motion):
    from headshop.headshop_addon import bridge

    bridge.ensure_shape_key(skin, "sculpted")
    write(performance, skin, motion)
    write(performance, skin, motion)
    assert len(bpy.data.actions) == 1
    assert len(skin.data.shape_keys.key_blocks) == 2 + 3
    performance.remove_performance(skin)
    assert len(bpy.data.actions) == 0 and skin.data.shape_keys.key_blocks.keys() == ["Basis", "sculpted"]


def test_the_artists_own_animation_stays(bpy, skin, performance, motion, reference):
    from headshop.headshop_addon import bridge

    own = bridge.ensure_shape_key(skin, "sculpted")
    bridge.write_positions(skin, reference.skin.vertices + 7.0, "sculpted")
    own.value = 0.0
    own.keyframe_insert("value", frame=1)
    own.value = 1.0
    own.keyframe_insert("value", frame=12)
    write(performance, skin, motion)
    wanted = reference.skin.vertices + motion["skin"][11] + 7.0
    np.testing.assert_allclose(played(bpy, skin, 12), wanted, atol=0.003)
    performance.remove_performance(skin)
    assert len(bpy.data.actions) == 1
    np.testing.assert_allclose(played(bpy, skin, 12), reference.skin.vertices + 7.0, atol=0.003)


def test_keyed_sliders_become_poses(bpy, skin, performance):
    """The sliders' F-curves are read in their slot; the extension's properties need not exist for that."""
    action = bpy.data.actions.new("sliders")
    slot = action.slots.new(id_type="OBJECT", name="skin")
    bag = action.layers.new("Layer").strips.new(type="KEYFRAME").channelbag(slot, ensure=True)
    for path, values in (
        ("headshop.muscles.risorius_l", (0, 1)),
        ("headshop.controls.jaw_open", (1, 0)),
        ("location", (0, 9)),
    ):
        curve = bag.fcurves.new(path)
        for frame, value in zip((1, 11), values, strict=True):
            curve.keyframe_points.insert(frame, value).interpolation = "LINEAR"
    assert not performance.is_keyed(skin)
    skin.animation_data_create().action = action
    skin.animation_data.action_slot = slot
    assert performance.is_keyed(skin)
    poses = performance.keyed_poses(skin, [1, 6, 11])
    assert [pose.muscles.get("risorius_l", 0) for pose in poses] == pytest.approx([0, 0.5, 1])
    assert [pose.jaw_open for pose in poses] == pytest.approx([1, 0.5, 0])


def test_a_simulated_performance_plays_without_the_extension(
    bpy, skin, performance, tmp_path, reference_model, monkeypatch
):
    monkeypatch.setattr("headshop.sim.tissue.model.build_model", lambda head: reference_model)

    poses = [Pose({"zygomaticus_major_l": k / 4}, jaw_open=k / 8) for k in range(5)]
    report = finish(performance.bake_performance(skin, poses))
    assert report["frames"] == 5 and report["error_mm"] <= performance.TOLERANCE and report["peak_mm"] > 1
    assert report["keys"]["mandible"] <= 4
    path = tmp_path / "acting.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    done = subprocess.run([sys.executable, "-c", _PLAYER, str(path)], capture_output=True, text=True, check=True)
    skin_moved, jaw_moved = map(float, done.stdout.split()[-2:])
    assert skin_moved == pytest.approx(report["peak_mm"], abs=0.01) and jaw_moved > 3


def test_a_bake_says_what_it_baked_itself(bpy, skin, monkeypatch):
    from headshop.headshop_addon import baking, heads
    from headshop.sim.acting import expressions
    from headshop.sim.acting.performance import Performance

    table = expressions.expressions()

    def bake(*names, **wanted):
        monkeypatch.setattr(expressions, "expressions", lambda: {name: table[name] for name in names})
        return baking.summary(finish(baking.bake(skin, model="waters", **wanted)))

    assert bake("smile", "frown", pose_set="expressions").startswith("2 shapes (")
    assert bake("blink", pose_set="expressions").startswith("1 shapes (")
    acted = Performance({"jaw_open": ((0.0, 0.0), (1.0, 0.2))}, 2.0)
    assert bake(acted=acted) == "3 frames in 2 shape keys of the skin"
    report = heads.read_report(skin)
    assert report["shapes"].keys() == {"smile", "frown", "blink"} and report["performance"]["frames"] == 3


def test_more_frames_than_memory_holds_are_refused_at_once(bpy, skin, performance):
    """Ten hours, which a file may hold, ended after many of them in: not enough memory."""
    from headshop.headshop_addon import baking
    from headshop.sim.acting.performance import Performance

    acted = Performance({"jaw_open": ((0.0, 0.0), (36000.0, 0.2))}, 24.0)
    with pytest.raises(InputError, match="864,001 frames .* bake 10,000 or fewer"):
        finish(baking.bake(skin, "expressions", acted))
    with pytest.raises(InputError, match="10,001 frames"):
        finish(performance.bake_performance(skin, [Pose()] * 10_001))
    assert not baking.is_baked(skin)


def test_a_slow_performance_bakes_at_its_own_rate(bpy, skin):
    from headshop.headshop_addon import baking, head_place
    from headshop.sim.acting.performance import Performance

    acted = Performance({"jaw_open": ((0.0, 0.0), (5.0, 0.2))}, 0.4)
    finish(baking.bake(skin, acted=acted, model="waters"))
    assert head_place.frame_rate(bpy.context.scene) == pytest.approx(0.4) and bpy.context.scene.frame_end == 3


_PLAYER = """
import sys, bpy, numpy as np
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
assert "headshop" not in sys.modules and not hasattr(bpy.types.Object, "headshop")
def positions(name):
    obj = bpy.data.objects[name]
    for modifier in obj.modifiers:
        modifier.show_viewport = False
    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    return np.array([v.co for v in mesh.vertices]) * 1000
moved = []
for name in ("Fran Skin", "Fran Mandible"):
    at = []
    for frame in (1, 5):
        bpy.context.scene.frame_set(frame)
        at.append(positions(name))
    moved.append(np.linalg.norm(at[1] - at[0], axis=1).max())
print(*moved)
"""


def test_one_of_a_kind_is_said_to_be_one(bpy):
    from headshop.headshop_addon import baking

    assert baking.summary({"performance": {"frames": 1, "keys": {"skin": 1}}}) == "1 frame in 1 shape key of the skin"
