# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks stay on a scan whose mesh an artist moves within the object: another origin, an applied rotation or scale."""

import json
import math

import numpy as np
import pytest

NAMES = ("prn", "ex_r", "ex_l", "gn", "ch_l", "v")
#: From the axes of the scan's file, Y up, to its own space.
TURN = [1.0, 0, 0, 0, 0, -1.0, 0, 1.0, 0]


@pytest.fixture
def scan(addon, scan_object, reference):
    """A scan with landmarks on vertices of its mesh, that stands aslant in the scene."""
    from headshop.headshop_addon import scan_landmarks, scan_objects

    scan_object[scan_objects.TURN] = TURN
    scan_landmarks.replace(scan_object, {name: _vertices(scan_object)[_nearest(reference, name)] for name in NAMES})
    scan_objects.select(addon.context, scan_object)
    scan_object.location = (0.3, -2.0, 1.2)
    scan_object.rotation_euler = (0.4, -0.7, 2.0)
    scan_object.scale = (2.0, 2.0, 2.0)
    addon.context.view_layer.update()
    return scan_object


def _nearest(reference, name):
    """The vertex that a landmark is put on."""
    return int(np.linalg.norm(reference.skin.vertices - reference.landmark_positions()[name], axis=1).argmin())


def _vertices(scan):
    from headshop.headshop_addon import bridge

    return bridge.read_positions(scan)


def _move_vertices(scan, moved):
    from headshop.headshop_addon import bridge

    bridge.write_positions(scan, moved)


def _off(scan, reference, stored=False):
    """mm from where landmarks are said, or stored, to be to the vertices that they were put on."""
    from headshop.headshop_addon import scan_landmarks

    told = scan_landmarks.positions(scan)
    if stored:
        told = {i.name: 1000 * np.array(i.co) for i in scan.headshop.landmarks if i.state == "PLACED"}
    assert set(told) == set(NAMES)
    return max(np.linalg.norm(place - _vertices(scan)[_nearest(reference, name)]) for name, place in told.items())


def _stored(scan):
    return [(i.name, tuple(i.co), tuple(i.found)) for i in scan.headshop.landmarks], [
        list(scan[key]) for key in ("headshop_turn", "headshop_shift") if key in scan
    ]


def _written(addon, path):
    assert addon.ops.headshop.save_landmarks(filepath=str(path)) == {"FINISHED"}
    return {name: np.array(place) for name, place in json.loads(path.read_text())["landmarks"].items()}


def _origin(bpy):
    return bpy.ops.object.origin_set(type="ORIGIN_GEOMETRY")


def _rotation(bpy):
    return bpy.ops.object.transform_apply(location=False, rotation=True, scale=False)


def _all_transforms(bpy):
    return bpy.ops.object.transform_apply()


def _mirror(bpy):
    bpy.context.object.scale = (-1.0, 1.5, 0.7)
    return bpy.ops.object.transform_apply(location=False, rotation=False, scale=True)


def _move_in_edit_mode(bpy):
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0.1, 0.2, 0.3))
    return bpy.ops.object.mode_set(mode="OBJECT")


MOVES = [_origin, _rotation, _all_transforms, _mirror, _move_in_edit_mode]


@pytest.mark.parametrize("move", MOVES)
def test_landmarks_go_with_the_mesh_and_files_stay_in_the_scans_axes(addon, scan, reference, tmp_path, move):
    from headshop.headshop_addon import scan_landmarks

    before, lay = _written(addon, tmp_path / "before.json"), _vertices(scan)
    assert move(addon) == {"FINISHED"}
    assert np.abs(_vertices(scan) - lay).max() > 20.0, "else the test tests nothing"
    assert _off(scan, reference) < 0.01
    after = _written(addon, tmp_path / "after.json")
    assert _off(scan, reference, stored=True) < 0.01, "an operator makes it last"
    for name, place in before.items():
        assert after[name] == pytest.approx(place, abs=0.01)
    scan_landmarks.forget(scan)
    assert addon.ops.headshop.load_landmarks(filepath=str(tmp_path / "before.json")) == {"FINISHED"}
    assert _off(scan, reference) < 0.01


def test_an_applied_scale_makes_the_scan_as_large_as_it_is_shown(addon, scan, reference):
    from headshop.headshop_addon import scan_landmarks

    before = scan_landmarks.positions(scan)
    addon.ops.object.transform_apply(location=False, rotation=False, scale=True)
    after = scan_landmarks.positions(scan)
    for name, place in before.items():
        assert after[name] == pytest.approx(2 * place, abs=0.01)


def test_one_move_after_another_with_and_without_an_operator_between(addon, scan, reference):
    from headshop.headshop_addon import scan_landmarks

    scan.location = (40.0, -30.0, 10.0)
    for move in (_all_transforms, _origin, _rotation, _origin):
        move(addon)
        scan.rotation_euler = (1.0, 0.3, -0.4)
    assert _off(scan, reference) < 0.05, "what is 50 m away is rounded to micrometres"
    scan_landmarks.entries(scan)
    for move in (_rotation, _mirror):
        move(addon)
        scan_landmarks.entries(scan)
    assert _off(scan, reference, stored=True) < 0.05


@pytest.mark.parametrize("saved", ["before", "after"])
def test_landmarks_follow_in_a_file_that_was_saved_and_opened_again(addon, scan, reference, tmp_path, saved):
    def save():
        addon.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scan.blend"))
        addon.ops.wm.open_mainfile(filepath=str(tmp_path / "scan.blend"))

    if saved == "before":
        save()
    _all_transforms(addon)
    if saved == "after":
        save()
    assert _off(addon.context.scene.headshop.scan, reference) < 0.01


def test_a_copy_follows_by_itself(addon, scan, reference):
    addon.ops.object.duplicate()
    copy = addon.context.object
    assert copy is not scan and copy.data is not scan.data
    _all_transforms(addon)
    assert np.abs(_vertices(copy) - _vertices(scan)).max() > 20.0
    assert _off(copy, reference) < 0.01 and _off(scan, reference) < 0.01


@pytest.mark.parametrize("settled", [False, True])
def test_undo_takes_the_landmarks_back_with_the_mesh(addon, scan, reference, tmp_path, settled):
    addon.ops.ed.undo_push(message="before")
    before = _written(addon, tmp_path / "before.json")
    addon.ops.object.origin_set("EXEC_DEFAULT", True, type="ORIGIN_GEOMETRY")
    if settled:
        _written(addon, tmp_path / "between.json")
    assert _off(addon.context.scene.headshop.scan, reference) < 0.01
    for step in (addon.ops.ed.undo, addon.ops.ed.redo):
        step()
        assert _off(addon.context.scene.headshop.scan, reference) < 0.01
    after = _written(addon, tmp_path / "after.json")
    assert after["prn"] == pytest.approx(before["prn"], abs=0.01)


def test_the_overlay_draws_them_on_the_mesh_and_writes_nothing(addon, scan, reference):
    from headshop.headshop_addon import landmark_overlay

    before = {name: place for name, _, place in landmark_overlay.points(addon.context)}
    assert len(before) == 60
    for move in (_origin, _rotation):  # both leave the mesh where it is in the scene
        move(addon)
    addon.context.view_layer.update()
    stored = _stored(scan)
    drawn = landmark_overlay.points(addon.context)
    assert _stored(scan) == stored
    for name, _, place in drawn:
        assert (place - before[name]).length < 1e-5


def test_what_was_found_goes_along(addon, scan):
    from headshop.headshop_addon import scan_landmarks
    from headshop.sim.landmarks.find import FoundLandmarks

    places = scan_landmarks.positions(scan, "DERIVED", "PLACED")
    scan_landmarks.take_found(scan, FoundLandmarks(places, dict.fromkeys(places, 0.9), (), ()))
    lay = _vertices(scan)
    _origin(addon)
    shift = (_vertices(scan) - lay)[0]
    for _ in range(2):
        for name, place in scan_landmarks.found(scan)[0].items():
            assert place == pytest.approx(places[name] + shift, abs=0.01)
        scan_landmarks.entries(scan)


def test_sculpting_leaves_them_and_what_comes_after_it_moves_them(addon, scan, reference):
    from headshop.headshop_addon import mesh_follow, scan_landmarks

    stored, before = _stored(scan), scan_landmarks.positions(scan)
    sculpted = _vertices(scan)
    sculpted[list(scan[mesh_follow.KEPT]["indices"])[:2]] += (5.0, -3.0, 9.0)
    _move_vertices(scan, sculpted)
    assert mesh_follow.change(scan) is None
    _origin(addon)
    shift = (_vertices(scan) - sculpted)[0]
    assert np.linalg.norm(shift) > 1.0
    for name, place in scan_landmarks.positions(scan).items():
        assert place == pytest.approx(before[name] + shift, abs=0.01)
    assert _stored(scan) == stored


def test_a_mesh_that_no_map_explains_leaves_them(addon, scan):
    from headshop.headshop_addon import scan_landmarks

    before = scan_landmarks.positions(scan)
    points = _vertices(scan)
    _move_vertices(scan, points + 5.0 * np.sin(points[:, [1, 2, 0]] / 20.0))
    after = scan_landmarks.positions(scan)
    assert all(np.array_equal(after[name], place) for name, place in before.items())
    scan_landmarks.entries(scan)
    addon.ops.object.transform_apply(location=False, rotation=False, scale=True)  # from where they were left
    for name, place in scan_landmarks.positions(scan).items():
        assert place == pytest.approx(2 * before[name], abs=0.01)


def test_deleted_vertices_leave_them_and_they_go_on_from_there(addon, scan):
    import bmesh

    from headshop.headshop_addon import scan_landmarks

    before = scan_landmarks.positions(scan)
    cut = bmesh.new()
    cut.from_mesh(scan.data)
    bmesh.ops.delete(cut, geom=list(cut.verts)[-50:])
    cut.to_mesh(scan.data)
    cut.free()
    after = scan_landmarks.positions(scan)
    assert all(np.array_equal(after[name], place) for name, place in before.items())
    scan_landmarks.entries(scan)
    addon.ops.object.transform_apply(location=False, rotation=False, scale=True)
    for name, place in scan_landmarks.positions(scan).items():
        assert place == pytest.approx(2 * before[name], abs=0.01)


def test_a_scan_of_an_earlier_version_follows_from_the_first_operator_on(addon, scan, reference, tmp_path):
    from headshop.headshop_addon import mesh_follow

    del scan[mesh_follow.KEPT]
    assert _off(scan, reference) < 0.01
    _written(addon, tmp_path / "landmarks.json")
    _all_transforms(addon)
    assert _off(scan, reference) < 0.01


def test_what_the_extension_itself_turns_and_resizes_is_followed_as_well(addon, scan, reference, tmp_path):
    from headshop.headshop_addon import scan_objects

    before = _written(addon, tmp_path / "before.json")
    _origin(addon)
    scan_objects.resize(scan, 0.5)
    assert _off(scan, reference, stored=True) < 0.01
    _rotation(addon)
    assert _off(scan, reference) < 0.01
    after = _written(addon, tmp_path / "after.json")
    for name, place in before.items():
        assert after[name] == pytest.approx(0.5 * place, abs=0.01), "millimetres, of which there are half as many now"


def test_a_map_is_told_from_what_only_looks_like_one():
    from headshop.headshop_addon.mesh_follow import affine, moved

    points = np.random.default_rng(1).normal(scale=100.0, size=(12, 3))
    angle = math.radians(30.0)
    turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1.2]])
    there = points @ turn.T + (500.0, 0, -20.0)
    assert moved(affine(points, there), points) == pytest.approx(there, abs=1e-6)
    for count in (1, 2, 3, 4):
        some = there.copy()
        some[:count] += np.array([[9.0, 0, 0], [0, -7, 3], [4, 4, 4], [-8, 1, 2]])[:count]
        found = affine(points, some)
        assert found is None if count == 4 else moved(found, points) == pytest.approx(there, abs=1e-6)
    assert affine(points, points + 1e-6) is None, "rounding"
    assert affine(points, points * (1.0, 1.0, 0.0)) is None, "flattened, from which nothing leads back"
