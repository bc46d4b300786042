# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked poses are ordinary shape keys: exact, driven along, replaced without touching the artist's own."""

import numpy as np
import pytest

from headshop.sim.errors import InputError
from headshop.sim.progress import finish


@pytest.fixture
def skin(bpy, reference):
    from headshop.headshop_addon import heads

    heads.create_head(reference, "Fran")
    return heads.find_heads()[0]


@pytest.fixture
def shape_keys(bpy):
    from headshop.headshop_addon import shape_keys

    return shape_keys


def deltas(reference, *parts, size=2.0):
    return {part: np.full_like(reference.parts[part].vertices, size) for part in parts}


def names(obj):
    return [block.name for block in obj.data.shape_keys.key_blocks] if obj.data.shape_keys else []


def test_parts_follow_the_skin_without_python(bpy, skin, shape_keys, reference):
    from headshop.headshop_addon import bridge, heads

    shape_keys.write_shapes(skin, {"joy": deltas(reference, "skin", "mandible")}, {"joy": {"peak_mm": 2.0}})
    mandible, tongue = (heads.parts_of(skin)[part] for part in ("mandible", "tongue"))
    assert names(skin) == names(mandible) == ["Basis", "joy"] and names(tongue) == []
    assert shape_keys.baked_report(skin) == {"joy": {"peak_mm": 2.0}}
    driver = mandible.data.shape_keys.animation_data.drivers[0].driver
    assert driver.type != "SCRIPTED" and not driver.expression.strip("0.")
    skin.data.shape_keys.key_blocks["joy"].value = 0.25
    bpy.context.view_layer.update()
    assert mandible.data.shape_keys.key_blocks["joy"].value == pytest.approx(0.25)
    moved = bridge.read_positions(mandible, "joy") - reference.parts["mandible"].vertices
    np.testing.assert_allclose(moved, 2.0, atol=1e-3)


def test_baking_again_replaces_only_ours(skin, shape_keys, reference):
    from headshop.headshop_addon import baking, bridge, heads

    bridge.ensure_shape_key(skin, "sculpted")
    shape_keys.write_shapes(skin, {k: deltas(reference, "skin", "mandible") for k in ("joy", "fear")}, {})
    skin.data.shape_keys.key_blocks["joy"].value = 0.5
    shape_keys.write_shapes(skin, {"joy": deltas(reference, "skin", size=3.0)}, {})
    assert names(skin) == ["Basis", "sculpted", "joy", "fear"]
    assert names(heads.parts_of(skin)["mandible"]) == ["Basis", "fear"]
    assert skin.data.shape_keys.key_blocks["joy"].value == 0.5
    moved = bridge.read_positions(skin, "joy") - reference.skin.vertices
    np.testing.assert_allclose(moved, 3.0, atol=1e-3)
    baking.remove_baked(skin)
    assert names(skin) == ["Basis", "sculpted"] and names(heads.parts_of(skin)["mandible"]) == []


@pytest.mark.parametrize("part", ["skin", "tongue"])
def test_a_key_of_the_artists_own_is_not_replaced(skin, shape_keys, part):
    from headshop.headshop_addon import bridge, heads
    from headshop.sim.acting.pose import Pose

    bridge.ensure_shape_key(heads.parts_of(skin)[part], "joy")
    with pytest.raises(InputError, match="'joy' of your own"):
        finish(shape_keys.bake_poses(skin, {"joy": Pose()}))


def test_a_bake_is_the_simulation(skin, shape_keys, reference_model):
    from headshop.headshop_addon import bridge
    from headshop.sim.acting.pose import Pose, control
    from headshop.sim.tissue.solver import solve

    pose = Pose({"zygomaticus_major_l": 0.8}, jaw_open=0.3)
    report = finish(shape_keys.bake_poses(skin, {"grin": pose, "nothing": Pose()}))
    model = reference_model
    truth = solve(model, control(model, pose), max_iterations=shape_keys.ITERATIONS).state.skin
    # Blender keeps single precision, which is enough for lips in contact to rest a little elsewhere.
    off = np.linalg.norm(bridge.read_positions(skin, "grin") - truth, axis=1)
    assert off.max() < 0.1 and np.sqrt((off**2).mean()) < 0.005, (off.max(), np.sqrt((off**2).mean()))
    kept = {"model", "peak_mm", "volume_drift", "penetration_mm", "converged"}
    assert report["grin"].keys() == kept | set(shape_keys.MORE)
    assert report["grin"]["peak_mm"] > 2 and report["nothing"]["peak_mm"] < 0.1


def test_a_shape_over_another_is_the_difference_to_it(skin, shape_keys, reference, reference_model):
    """`mouthClose` plays on top of `jawOpen`: both keys together are the two poses simulated together."""
    from headshop.headshop_addon import baking, bridge
    from headshop.sim.acting.pose import combined, control
    from headshop.sim.tissue.solver import solve

    poses, over = baking.poses_of_set(skin, "arkit")
    assert len(poses) == 52 and over == {"mouthClose": "jawOpen"}
    poses = {name: poses[name] for name in ("jawOpen", "mouthClose")}
    finish(shape_keys.bake_poses(skin, poses, over=over))
    rest = reference.skin.vertices
    both = rest + sum(bridge.read_positions(skin, name) - rest for name in poses)
    asked = control(reference_model, combined(poses["jawOpen"], poses["mouthClose"]))
    truth = solve(reference_model, asked, max_iterations=shape_keys.ITERATIONS).state.skin
    assert np.sqrt(((both - truth) ** 2).sum(axis=1).mean()) < 0.01
    alone = np.linalg.norm(bridge.read_positions(skin, "mouthClose") - rest, axis=1).max()
    assert alone > 5  # the lips come back together


def test_a_cancelled_bake_leaves_no_trace(skin, shape_keys, reference_model, monkeypatch):
    from headshop.sim.acting.pose import Pose

    monkeypatch.setattr("headshop.sim.tissue.model.build_model", lambda head: reference_model)

    work = shape_keys.bake_poses(skin, {"a": Pose(jaw_open=0.2), "b": Pose(jaw_open=0.4)})
    steps = [next(work) for _ in range(3)]
    work.close()
    assert steps[-1].label.endswith("b") and names(skin) == [] and shape_keys.SHAPES not in skin


def test_linked_heads_are_refused(bpy, skin, shape_keys, tmp_path):
    from headshop.headshop_addon import heads

    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "head.blend"), copy=True)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / "head.blend"), link=True) as (_, wanted):
        wanted.collections = ["Fran"]
    bpy.context.scene.collection.children.link(bpy.data.collections["Fran"])
    with pytest.raises(InputError, match="linked"):
        finish(shape_keys.bake_poses(heads.find_heads()[0], {}))


def test_the_face_as_scanned_stays_beside_what_is_baked(skin, shape_keys, reference):
    from headshop.headshop_addon import baking, bridge, heads

    smiling = reference.skin.vertices + 1.5
    shape_keys.keep_as_scanned(skin, smiling)
    assert names(skin) == ["Basis", shape_keys.SCANNED]
    assert skin.data.shape_keys.key_blocks[shape_keys.SCANNED].value == 0
    np.testing.assert_allclose(bridge.read_positions(skin, shape_keys.SCANNED), smiling, atol=1e-3)
    np.testing.assert_allclose(heads.read_head(skin).skin.vertices, reference.skin.vertices, atol=1e-3)
    shape_keys.write_shapes(skin, {"joy": deltas(reference, "skin")}, {})
    baking.remove_baked(skin)
    assert names(skin) == ["Basis", shape_keys.SCANNED]
    assert shape_keys.baked_names(skin) == []
