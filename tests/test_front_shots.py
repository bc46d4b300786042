# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads in shots: linked and overridden, several of one kind, duplicated, moved by drivers and NLA strips."""

import numpy as np
import pytest


@pytest.fixture
def whole(addon, reference):
    """The skin of a head made of the reference, whose muscles displace the skin directly: fast."""
    from headshop.headshop_addon import heads

    heads.create_head(reference, "Ref")
    skin = heads.find_heads()[0]
    skin.headshop.model = "DIRECT"
    return skin


@pytest.fixture
def library(addon, reference, tmp_path):
    """Path of a .blend with a head whose sliders nobody touched, and that no session with the extension made."""
    from headshop.headshop_addon import heads

    heads.create_head(reference, "Ref")
    path = str(tmp_path / "ref.blend")
    addon.ops.wm.save_as_mainfile(filepath=path)
    addon.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return path


def overridden(bpy, path):
    """The skin of a library override of the head in a .blend, in the scene."""
    from headshop.headshop_addon import heads

    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.collections = ["Ref"]
    made = wanted.collections[0].override_hierarchy_create(
        bpy.context.scene, bpy.context.view_layer, do_fully_editable=True
    )
    skin = next(obj for obj in made.objects if heads.is_skin(obj))
    bpy.context.view_layer.update()
    skin.headshop.model = "DIRECT"
    return skin


def reopened(bpy, tmp_path):
    """Save the shot and open it again."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))


def moved(skin, part="skin") -> float:
    """Largest motion of a part in the live pose, mm."""
    from headshop.headshop_addon import bridge, following, heads

    obj = heads.parts_of(skin)[part]
    keys = obj.data.shape_keys
    if keys is None or following.KEY not in keys.key_blocks:
        return 0.0
    delta = bridge.read_positions(obj, following.KEY) - bridge.read_positions(obj)
    return float(np.linalg.norm(delta, axis=1).max())


def duplicate(bpy, objects, linked=False):
    """Shift-D or Alt-D."""
    for obj in bpy.context.view_layer.objects:
        obj.select_set(False)
    for obj in objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = objects[0]
    bpy.ops.object.duplicate(linked=linked)


def test_an_overridden_head_opens_as_the_shot_was_saved(addon, library, tmp_path):
    from headshop.headshop_addon import heads

    skin = overridden(addon, library)
    skin.headshop.muscles.zygomaticus_major_l = 0.7
    skin.headshop.controls.jaw_open = 0.5
    before = moved(skin), moved(skin, "mandible")
    assert min(before) > 1
    reopened(addon, tmp_path)
    skin = heads.find_heads()[0]
    assert skin.override_library and skin.headshop.model == "DIRECT"
    assert skin.headshop.muscles.zygomaticus_major_l == pytest.approx(0.7)
    assert skin.headshop.controls.jaw_open == pytest.approx(0.5)
    assert (moved(skin), moved(skin, "mandible")) == pytest.approx(before, abs=1e-3)


def test_a_slider_of_an_override_that_only_a_script_with_the_face_switched_off_set_is_kept_too(
    addon, library, tmp_path
):
    from headshop.headshop_addon import heads

    skin = overridden(addon, library)
    skin.headshop.live = False
    skin.headshop.controls.gaze_x = 0.5
    reopened(addon, tmp_path)
    skin = heads.find_heads()[0]
    assert skin.headshop.controls.gaze_x == 0.5 and not skin.headshop.live and moved(skin, "eye_l") == 0


def test_two_overrides_of_one_head_move_each_for_itself(addon, library, tmp_path):
    from headshop.headshop_addon import heads

    one, other = overridden(addon, library), overridden(addon, library)
    assert one.data == other.data
    one.headshop.controls.gaze_x = 1.0
    other.headshop.controls.jaw_open = 0.5
    reopened(addon, tmp_path)
    one, other = heads.find_heads()
    assert moved(one, "eye_l") > 5 and moved(one, "mandible") == 0
    assert moved(other, "eye_l") == 0 and moved(other, "mandible") > 5


def test_a_linked_head_says_what_to_do(addon, library):
    from headshop.headshop_addon import polls

    with addon.data.libraries.load(library, link=True) as (_, wanted):
        wanted.collections = ["Ref"]
    addon.context.scene.collection.children.link(wanted.collections[0])
    addon.context.view_layer.update()
    for act in (addon.ops.headshop.key_sliders, addon.ops.headshop.reset_muscles, addon.ops.headshop.dress_head):
        with pytest.raises(RuntimeError, match=polls.LINKED):
            act()


def test_a_linked_duplicate_moves_for_itself_and_keeps_its_baked_shapes(addon, whole):
    from headshop.headshop_addon import baking, bridge, heads, shape_keys

    still = np.zeros((len(heads.parts_of(whole)["mandible"].data.vertices), 3))
    pose = {"joy": {"skin": np.ones((len(whole.data.vertices), 3)), "mandible": still + 1}}
    shape_keys.write_shapes(whole, pose, {"joy": {"peak_mm": 1.0}})
    duplicate(addon, [whole, *whole.children], linked=True)
    copy = next(skin for skin in heads.find_heads() if skin != whole)
    assert copy.data == whole.data
    copy.headshop.controls.gaze_x = 1.0
    assert moved(copy, "eye_l") > 5 and moved(whole, "eye_l") == 0
    jaw = heads.parts_of(copy)["mandible"].data.shape_keys
    assert jaw.animation_data.drivers[0].driver.variables[0].targets[0].id == copy.data.shape_keys
    baking.remove_baked(copy)
    assert "joy" in whole.data.shape_keys.key_blocks
    assert bridge.read_positions(whole, "joy").mean() - bridge.read_positions(whole).mean() == pytest.approx(
        1, abs=1e-3
    )


def test_a_skin_duplicated_alone_leaves_the_head_it_came_from_alone(addon, whole):
    from headshop.headshop_addon import heads

    duplicate(addon, [whole])
    copy = next(skin for skin in heads.find_heads() if skin != whole)
    copy.headshop.controls.gaze_x = copy.headshop.controls.jaw_open = 1.0
    assert moved(whole, "eye_l") == 0 and moved(whole, "mandible") == 0
    assert "eye_l" in heads.lacking(copy) and "children" in heads.lacking(copy)
    assert not heads.lacking(whole)


def test_the_face_follows_a_driver_without_a_change_of_frame(addon, whole):
    empty = _driven_by_an_empty(addon, whole)
    empty.location.x = 0.5
    addon.context.view_layer.update()
    half = moved(whole, "mandible")
    empty.location.x = 1.0
    addon.context.view_layer.update()
    assert 5 < half < moved(whole, "mandible")


def test_a_driver_and_nla_strips_are_baked_as_they_play(addon, whole):
    from headshop.headshop_addon import performance

    scene = addon.context.scene
    empty = _driven_by_an_empty(addon, whole)
    for frame, value in ((1, 0.0), (11, 1.0)):
        empty.location.x = value
        empty.keyframe_insert("location", frame=frame)
        whole.headshop.muscles.corrugator_l = value
        whole.keyframe_insert("headshop.muscles.corrugator_l", frame=frame)
    data = whole.animation_data
    strip = data.nla_tracks.new().strips.new("frown", 11, data.action)
    data.action = None
    scene.frame_set(4)
    assert performance.is_keyed(whole)
    poses = performance.keyed_poses(whole, [1, 6, 11, 21], scene)
    assert [pose.jaw_open for pose in poses] == pytest.approx([0, 0.5, 1, 1], abs=1e-5)
    assert [pose.muscles.get("corrugator_l", 0.0) for pose in poses] == pytest.approx([0, 0, 0, 1], abs=1e-5)
    assert scene.frame_current == 4
    whole.driver_remove("headshop.controls.jaw_open")
    assert performance.is_keyed(whole)
    strip.mute = True
    assert not performance.is_keyed(whole)


def _driven_by_an_empty(bpy, skin):
    """An empty along whose X the jaw opens."""
    empty = bpy.data.objects.new("Control", None)
    bpy.context.scene.collection.objects.link(empty)
    driver = skin.driver_add("headshop.controls.jaw_open").driver
    driver.type = "SUM"
    variable = driver.variables.new()
    variable.type = "TRANSFORMS"
    variable.targets[0].id, variable.targets[0].transform_type = empty, "LOC_X"
    return empty


@pytest.mark.parametrize("how", ["instance", "collection", "blender's override"])
def test_a_linked_head_is_overridden_by_one_button(addon, library, how):
    from headshop.headshop_addon import active, heads

    scene, layer = addon.context.scene, addon.context.view_layer
    with addon.data.libraries.load(library, link=True) as (_, wanted):
        wanted.collections = ["Ref"]
    if how == "collection":
        scene.collection.children.link(wanted.collections[0])
    elif how == "instance":
        empty = addon.data.objects.new("Ref", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", wanted.collections[0]
        scene.collection.objects.link(empty)
        layer.objects.active = empty
        empty.select_set(True)
    else:
        wanted.collections[0].override_hierarchy_create(scene, layer)
    layer.update()
    assert active.linked(addon.context)
    addon.ops.headshop.override_head()
    (skin,) = heads.find_heads(scene)
    assert skin.library is None and not skin.override_library.is_system_override
    assert active.skin(addon.context) == skin and active.linked(addon.context) is None
    assert not addon.ops.headshop.override_head.poll()
    skin.headshop.model = "DIRECT"
    addon.ops.headshop.set_expression(expression="joy")
    assert moved(skin) > 3 and moved(skin, "mandible") > 1


def test_undo_after_a_slider_of_an_override_leaves_what_was_linked(addon, library):
    """Blender crashed: the linked mesh had been given a shape key, which undo took away from under it."""
    from headshop.headshop_addon import heads

    skin = overridden(addon, library)
    addon.ops.ed.undo_push(message="linked")
    skin.headshop.controls.jaw_open = 1.0
    addon.context.view_layer.update()
    assert all(obj.data.library is None for obj in heads.parts_of(skin).values())
    addon.ops.ed.undo_push(message="open")
    addon.ops.ed.undo()
    (skin,) = heads.find_heads()
    addon.context.view_layer.update()
    assert skin.headshop.controls.jaw_open == moved(skin) == 0
    addon.ops.ed.redo()
    (skin,) = heads.find_heads()
    assert moved(skin, "mandible") > 5


def test_what_is_baked_on_an_override_is_known_when_the_shot_is_opened(addon, library, tmp_path):
    from headshop.headshop_addon import baking, heads, performance, shape_keys
    from headshop.sim.acting.principal import principal_shapes

    skin = overridden(addon, library)
    motion = np.ones((2, len(skin.data.vertices), 3)) * np.array([0.0, 1.0])[:, None, None]
    performance.write_performance(skin, {"skin": principal_shapes(motion, 0.001)}, np.arange(1, 3), "Performance")
    shape_keys.write_shapes(skin, {"joy": {"skin": motion[1]}}, {"joy": {"peak_mm": 1.0}})
    reopened(addon, tmp_path)
    (skin,) = heads.find_heads()
    assert shape_keys.baked_names(skin) == ["joy"] and performance.baked_weights(skin) is not None
    baking.remove_baked(skin)
    assert skin.data.shape_keys is None and not baking.is_baked(skin)
    reopened(addon, tmp_path)
    assert not baking.is_baked(heads.find_heads()[0])


def test_an_export_says_that_keyed_sliders_are_not_in_it(addon, whole, tmp_path, capfd):
    """It wrote a statue and said 0 shapes."""
    path = str(tmp_path / "ref.glb")
    addon.ops.headshop.export_head(filepath=path)
    assert "0 shapes" in capfd.readouterr().out
    addon.ops.headshop.key_sliders()
    addon.ops.headshop.export_head(filepath=path)
    said = capfd.readouterr().out
    assert "bake Keyed Sliders to Animation first" in said and "shape" not in said
