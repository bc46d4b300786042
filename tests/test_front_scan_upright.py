# SPDX-License-Identifier: GPL-3.0-or-later
"""A scan that came in the wrong way up stands upright when its landmarks are found, with what was placed on it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from headshop.sim.landmarks import find
from headshop.sim.landmarks.find import FoundLandmarks
from headshop.sim.progress import Progress
from headshop.sim.scan.ply import write_ply

#: From the reference's place to one that lies on its side and is taken for upright.
ASIDE = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
FOUND = ("prn", "gn", "n", "en_l", "en_r", "ch_l", "ch_r")


@pytest.fixture
def truth(reference):
    return {name: reference.landmark_positions()[name] for name in FOUND}


@pytest.fixture
def lying(addon, reference, truth, tmp_path, monkeypatch):
    """``lying(turn, **options)`` -> the object of a scan that was read as upright as it lies, and whose landmarks are found."""
    from headshop.headshop_addon import pipeline

    def upright(mesh, *_, **__):
        yield Progress(0.5, "")
        return replace(_as_it_is(), unit="m", unit_scale=1000.0) if np.ptp(mesh.vertices) < 2.0 else _as_it_is()

    turned = [ASIDE]

    def found(mesh, **_):
        yield Progress(0.5, "")
        places = {name: turned[-1] @ place for name, place in truth.items()}
        return FoundLandmarks(places, dict.fromkeys(places, 0.9), (), (), 1.0, 1.0)

    def make(turn=ASIDE, **options):
        turned.append(turn)
        path = tmp_path / "scan.ply"
        write_ply(path, reference.skin.moved(reference.skin.vertices @ turn.T))
        assert addon.ops.headshop.import_scan(filepath=str(path), **options) == {"FINISHED"}
        return addon.context.scene.headshop.scan

    monkeypatch.setattr(pipeline, "detecting", upright)
    monkeypatch.setattr(find, "find_landmarks", found)
    return make


def _as_it_is():
    from headshop.sim.scan.orientation import Orientation

    return Orientation("mm", 1.0, "+Z", "-Y", np.eye(3), False, "Unsure.")


def _facts(obj):
    from headshop.headshop_addon import heads

    return json.loads(obj[heads.REPORT])["scan"]


def _points(obj):
    return 1000 * np.array([tuple(v.co) for v in obj.data.vertices])


def test_a_scan_that_lies_is_set_upright_with_its_landmarks(addon, lying, reference, truth, tmp_path):
    from headshop.headshop_addon import scan_landmarks

    scan = lying()
    scan_landmarks.put(scan, "sto", ASIDE @ [2.0, -90.0, 40.0])
    assert addon.ops.headshop.find_landmarks() == {"FINISHED"}
    assert np.abs(np.ptp(_points(scan), axis=0) - np.ptp(reference.skin.vertices, axis=0)).max() < 0.01
    assert scan_landmarks.positions(scan, "PLACED")["sto"] == pytest.approx([2.0, -90.0, 40.0], abs=1e-3)
    for name, place in scan_landmarks.positions(scan, "FOUND").items():
        assert place == pytest.approx(truth[name], abs=1e-3)
    facts = _facts(scan)
    assert facts["certain"] is True and (facts["up"], facts["front"]) == ("+X", "-Y")
    assert facts["orientation"] == ("Read as millimetres, +X up, face toward -Y: the landmarks that were found say so.")
    path = tmp_path / "landmarks.json"  # in the axes of the file, as before
    addon.ops.headshop.save_landmarks(filepath=str(path))
    assert json.loads(path.read_text())["landmarks"]["sto"] == pytest.approx(list(ASIDE @ [2.0, -90.0, 40.0]), abs=1e-3)


def test_a_scan_in_axes_that_nobody_set_is_set_upright_and_faces_forward(addon, lying, reference, truth, tmp_path):
    from headshop.headshop_addon import scan_landmarks

    turn = Rotation.from_euler("xyz", [40, 50, 45], degrees=True).as_matrix()
    scan = lying(turn)
    assert addon.ops.headshop.find_landmarks() == {"FINISHED"}
    np.testing.assert_allclose(_points(scan), reference.skin.vertices, atol=1e-2)
    for name, place in scan_landmarks.positions(scan, "FOUND").items():
        assert place == pytest.approx(truth[name], abs=1e-2)
    facts = _facts(scan)
    assert facts["certain"] is True and "degrees to stand upright and face forward" in facts["orientation"]
    np.testing.assert_allclose(facts["rotation"], turn.T, atol=1e-5)
    path = tmp_path / "landmarks.json"
    addon.ops.headshop.save_landmarks(filepath=str(path))
    assert json.loads(path.read_text())["landmarks"]["prn"] == pytest.approx(list(turn @ truth["prn"]), abs=1e-2)
    addon.ops.headshop.load_landmarks(filepath=str(path))
    assert scan_landmarks.positions(scan, "FOUND")["prn"] == pytest.approx(truth["prn"], abs=1e-2)


@pytest.mark.parametrize("unit", ["mm", "face"])
def test_a_scan_in_no_unit_stands_upright_where_one_in_millimetres_is_held_so(addon, lying, unit):
    from headshop.headshop_addon import heads

    scan = lying(Rotation.from_euler("xyz", [12, 15, 18], degrees=True).as_matrix())
    heads.write_report(scan, {"scan": _facts(scan) | {"unit": unit}})
    before = _points(scan)
    assert addon.ops.headshop.find_landmarks() == {"FINISHED"}
    assert np.array_equal(_points(scan), before) == (unit == "mm")


def test_what_an_artist_said_is_up_stays_up(addon, lying):
    scan = lying(up="+Z")
    before = _points(scan)
    assert addon.ops.headshop.find_landmarks() == {"FINISHED"}
    assert np.array_equal(_points(scan), before) and _facts(scan)["orientation"] == "Unsure."


def test_a_scan_that_stands_already_is_not_turned(addon, lying, truth, monkeypatch):
    def found(mesh, **_):
        yield Progress(0.5, "")
        return FoundLandmarks(truth, dict.fromkeys(truth, 0.9), (), (), 1.0, 1.0)

    scan = lying()
    monkeypatch.setattr(find, "find_landmarks", found)
    before = _points(scan)
    assert addon.ops.headshop.find_landmarks() == {"FINISHED"}
    assert np.array_equal(_points(scan), before) and _facts(scan)["orientation"] == "Unsure."


def test_an_adopted_scan_stays_in_its_originals_place(addon, lying, reference):
    import bpy
    from mathutils import Matrix

    from headshop.headshop_addon import bridge

    original = bridge.mesh_to_object(reference.skin.moved(reference.skin.vertices @ ASIDE.T), "Original")
    addon.context.scene.collection.objects.link(original)
    original.matrix_world = Matrix.Translation((1.0, 2.0, 3.0))
    bpy.context.view_layer.objects.active = original
    original.select_set(True)
    assert addon.ops.headshop.choose_scan() == {"FINISHED"}
    scan = addon.context.scene.headshop.scan

    def world():
        bpy.context.view_layer.update()
        return np.array([tuple(scan.matrix_world @ v.co) for v in scan.data.vertices])

    before, lay = world(), _points(scan)
    assert addon.ops.headshop.find_landmarks() == {"FINISHED"}
    assert np.abs(_points(scan) - lay).max() > 50.0
    assert np.abs(world() - before).max() < 1e-5
