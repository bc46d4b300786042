# SPDX-License-Identifier: GPL-3.0-or-later
"""One undo after each operator returns the whole file to what it was."""

import zlib
from functools import partial

import numpy as np
import pytest


@pytest.fixture
def scene(addon, reference, reference_model, monkeypatch):
    """A scan with landmarks and a head of the reference, active; the head's tissue is built once for all tests."""
    from headshop.headshop_addon import bridge, heads, scan_landmarks, scan_objects
    from headshop.sim.tissue import model

    monkeypatch.setattr(model, "build_model", lambda head: reference_model)
    scan = bridge.mesh_to_object(reference.skin, "Scan")
    addon.context.scene.collection.objects.link(scan)
    addon.context.scene.headshop.scan = scan
    scan_landmarks.replace(scan, reference.landmark_positions())
    heads.create_head(reference, "Ref")
    scan_objects.select(addon.context, heads.find_heads()[0])
    return addon


def _plain(value):
    """An ID property without addresses in memory."""
    if hasattr(value, "items"):
        return {key: _plain(item) for key, item in value.items()}
    if hasattr(value, "to_list"):
        return value.to_list()
    return getattr(value, "name", value)


def _id_properties(block) -> dict:
    return {key: _plain(block[key]) for key in block.keys() if key != "headshop"}


def _object(obj) -> dict:
    group = obj.headshop
    return {
        "properties": _id_properties(obj),
        "landmarks": [(i.name, tuple(i.co), i.state) for i in group.landmarks],
        "sliders": {**group.muscles.values(), **group.controls.values()},
        "live": group.live,
        "matrix": [tuple(row) for row in obj.matrix_world],
        "hidden": (obj.hide_viewport, obj.hide_render, obj.hide_get()),
        "parent": obj.parent and obj.parent.name,
        "modifiers": [modifier.name for modifier in obj.modifiers],
        "slots": [slot.material and slot.material.name for slot in obj.material_slots],
        "action": obj.animation_data and obj.animation_data.action and obj.animation_data.action.name,
    }


def _mesh(mesh) -> dict:
    co = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.vertices.foreach_get("co", co)
    keys = {}
    for block in mesh.shape_keys.key_blocks if mesh.shape_keys else ():
        points = np.empty(len(mesh.vertices) * 3, np.float32)
        block.points.foreach_get("co", points)
        keys[block.name] = (round(block.value, 6), zlib.crc32(points.tobytes()))
    return {"vertices": zlib.crc32(co.tobytes()), "keys": keys, "uv": [layer.name for layer in mesh.uv_layers]}


def describe(bpy) -> dict:
    """Everything an artist could tell apart."""
    scene = bpy.context.scene
    settings = scene.headshop
    return {
        "data": {
            kind: sorted(block.name for block in getattr(bpy.data, kind))
            for kind in (
                "objects",
                "meshes",
                "collections",
                "materials",
                "actions",
                "lights",
                "cameras",
                "worlds",
                "scenes",
            )
        },
        "objects": {obj.name: _object(obj) for obj in scene.objects},
        "meshes": {mesh.name: _mesh(mesh) for mesh in bpy.data.meshes},
        "settings": (settings.scan and settings.scan.name, settings.head and settings.head.name),
        "active": bpy.context.active_object and bpy.context.active_object.name,
        "camera": scene.camera and scene.camera.name,
        "engine": scene.render.engine,
        "frame": scene.frame_current,
    }


def assert_undone(bpy, call, **properties):
    """Run an operator as the window does, see that it did something, undo, and see that nothing of it is left."""
    bpy.ops.ed.undo_push(message="before")
    before = describe(bpy)
    assert call("EXEC_DEFAULT", True, **properties) == {"FINISHED"}
    assert describe(bpy) != before, "the operator did nothing"
    bpy.ops.ed.undo()
    after = describe(bpy)
    for part, value in before.items():
        assert after[part] == value, part


@pytest.mark.parametrize(
    ("name", "properties"),
    [
        ("clear_landmarks", {}),
        ("set_expression", {"expression": "joy", "amount": 0.5}),
        ("key_sliders", {}),
        ("dress_head", {}),
    ],
)
def test_undo_after(scene, name, properties):
    assert_undone(scene, getattr(scene.ops.headshop, name), **properties)


def test_undo_after_adding_the_sample(scene, monkeypatch):
    from headshop.sim.scan import sample
    from headshop.sim.scan.scanner import VirtualScanner

    coarse = partial(sample.make_sample, scanner=VirtualScanner(views=((0.0, 4.0),), pixel=6.0))
    monkeypatch.setattr(sample, "make_sample", coarse)
    assert_undone(scene, scene.ops.headshop.make_sample)


def test_undo_after_relaxing(scene):
    scene.context.active_object.headshop.muscles.corrugator_l = 0.4
    assert_undone(scene, scene.ops.headshop.reset_muscles)


def test_undo_after_loading_landmarks(scene, tmp_path):
    path = str(tmp_path / "landmarks.json")
    scene.ops.headshop.save_landmarks(filepath=path)
    scene.ops.headshop.clear_landmarks()
    assert_undone(scene, scene.ops.headshop.load_landmarks, filepath=path)


def test_undo_after_importing(scene, reference, tmp_path):
    from headshop.sim.scan.ply import write_ply

    write_ply(tmp_path / "scan.ply", reference.skin)
    assert_undone(scene, scene.ops.headshop.import_scan, filepath=str(tmp_path / "scan.ply"))


def test_undo_after_choosing_an_object(scene, reference):
    from headshop.headshop_addon import bridge, scan_objects

    obj = bridge.mesh_to_object(reference.skin, "Bust")
    scene.context.scene.collection.objects.link(obj)
    scan_objects.select(scene.context, obj)
    assert_undone(scene, scene.ops.headshop.choose_scan)


def test_undo_after_repacking(scene):
    pytest.importorskip("xatlas", reason="xatlas is not installed")
    assert_undone(scene, scene.ops.headshop.repack_uv)


def test_undo_after_building(scene):
    assert_undone(scene, scene.ops.headshop.build_head)


def test_undo_after_baking_expressions(scene, monkeypatch):
    from headshop.sim.acting import expressions
    from headshop.sim.acting.pose import Pose

    monkeypatch.setattr(expressions, "expressions", lambda: {"frown": Pose({"corrugator_l": 0.2})})
    assert_undone(scene, scene.ops.headshop.bake_expressions)


def test_undo_after_baking_muscles(scene, monkeypatch):
    from headshop.sim.acting import expressions
    from headshop.sim.acting.pose import Pose

    monkeypatch.setattr(expressions, "muscle_poses", lambda head: {"corrugator_l": Pose({"corrugator_l": 0.2})})
    assert_undone(scene, scene.ops.headshop.bake_muscles)


def test_undo_after_baking_a_performance(scene):
    frames = scene.context.scene
    frames.frame_start, frames.frame_end = 1, 2
    skin = scene.context.active_object
    for frame in (1, 2):
        skin.headshop.muscles.corrugator_l = 0.3 * (frame - 1)
        skin.keyframe_insert("headshop.muscles.corrugator_l", frame=frame)
    assert_undone(scene, scene.ops.headshop.bake_performance)
