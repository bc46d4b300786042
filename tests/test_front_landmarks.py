# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks on a scan object: stored with it, followed by the others, read from and written to files."""

import json

import numpy as np
import pytest

from headshop.sim.anatomy.landmark_names import SKIN


@pytest.fixture
def scan(scan_object):
    return scan_object


def test_every_landmark_is_asked_for_once():
    from headshop.headshop_addon import scan_landmarks

    assert sorted(scan_landmarks.ORDER) == sorted(SKIN)


def test_after_three_clicks_the_others_follow_to_where_they_belong(scan, reference):
    from headshop.headshop_addon import scan_landmarks

    truth = reference.landmark_positions()
    for count, name in enumerate(scan_landmarks.ORDER[:3], 1):
        scan_landmarks.put(scan, name, truth[name])
        scan_landmarks.follow(scan)
        assert len(scan_landmarks.positions(scan)) == count
        assert len(scan_landmarks.positions(scan, "DERIVED")) == (57 if count == 3 else 0)
    derived = scan_landmarks.positions(scan, "DERIVED")
    error = np.linalg.norm([derived[n] - truth[n] for n in derived], axis=1)
    assert error.max() < 1.0, "on the reference itself the warp is the identity"
    assert scan_landmarks.next_to_place(scan) == scan_landmarks.ORDER[3]
    assert scan_landmarks.next_to_place(scan, skipped=[scan_landmarks.ORDER[3]]) == scan_landmarks.ORDER[4]


def test_three_on_a_line_derive_nothing_and_do_not_fail(scan):
    from headshop.headshop_addon import scan_landmarks

    for k, name in enumerate(("prn", "ex_r", "ex_l")):
        scan_landmarks.put(scan, name, (10.0 * k, 0, 0))
    scan_landmarks.follow(scan)
    assert not scan_landmarks.positions(scan, "DERIVED")
    assert len(scan_landmarks.positions(scan)) == 3


def test_taking_back_a_click_restores_exactly(scan, reference):
    from headshop.headshop_addon import scan_landmarks

    truth = reference.landmark_positions()
    scan_landmarks.replace(scan, {n: truth[n] for n in ("prn", "ex_r", "ex_l", "gn")})
    before = scan_landmarks.snapshot(scan)
    scan_landmarks.put(scan, "ch_l", truth["ch_l"] + 3)
    scan_landmarks.follow(scan)
    assert scan_landmarks.snapshot(scan) != before
    scan_landmarks.restore(scan, before)
    assert scan_landmarks.snapshot(scan) == before


def test_files_are_in_the_axes_of_the_scans_own_file(addon, scan, reference, tmp_path):
    """The scan's file had Y up: x' = x, y' = z, z' = -y of ours."""
    from headshop.headshop_addon import scan_landmarks, scan_objects

    scan[scan_objects.TURN] = [1.0, 0, 0, 0, 0, -1.0, 0, 1.0, 0]
    truth = {name: reference.landmark_positions()[name] for name in ("prn", "ex_r", "ex_l", "gn", "ch_l")}
    scan_landmarks.replace(scan, truth)
    path = tmp_path / "landmarks.json"
    addon.ops.headshop.save_landmarks(filepath=str(path))
    document = json.loads(path.read_text())
    x, y, z = truth["prn"]
    assert document["landmarks"]["prn"] == pytest.approx([x, z, -y], abs=1e-3)
    assert len(document["missing"]) == 55
    addon.ops.headshop.clear_landmarks()
    assert not scan_landmarks.positions(scan, "PLACED", "DERIVED")
    addon.ops.headshop.load_landmarks(filepath=str(path))
    for name, position in scan_landmarks.positions(scan).items():
        assert position == pytest.approx(truth[name], abs=1e-3)
    assert set(scan_landmarks.positions(scan)) == set(truth)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("not json", "landmark"),
        ('{"format": "headshop-landmarks/1", "units": "mm", "landmarks": {"prn": [0, 0, 0]}}', "at least 4"),
        ('{"format": "headshop-landmarks/1", "units": "mm", "landmarks": {"nose": [0, 0, 0]}}', "nose"),
    ],
)
def test_a_bad_file_says_why_and_keeps_the_landmarks(addon, scan, reference, tmp_path, content, sentence):
    from headshop.headshop_addon import scan_landmarks

    truth = reference.landmark_positions()
    scan_landmarks.replace(scan, {n: truth[n] for n in ("prn", "ex_r", "ex_l", "gn")})
    before = scan_landmarks.snapshot(scan)
    path = tmp_path / "landmarks.json"
    path.write_text(content)
    with pytest.raises(RuntimeError, match=sentence) as raised:
        addon.ops.headshop.load_landmarks(filepath=str(path))
    assert "Traceback" not in str(raised.value)
    assert scan_landmarks.snapshot(scan) == before


def test_landmarks_survive_saving_and_loading(addon, scan, reference, tmp_path):
    from headshop.headshop_addon import scan_landmarks

    truth = reference.landmark_positions()
    scan_landmarks.replace(scan, {n: truth[n] for n in ("prn", "ex_r", "ex_l", "gn")})
    before = scan_landmarks.snapshot(scan)
    addon.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scan.blend"))
    addon.ops.wm.open_mainfile(filepath=str(tmp_path / "scan.blend"))
    assert scan_landmarks.snapshot(addon.context.scene.headshop.scan) == before


@pytest.mark.parametrize("overridden", [False, True])
def test_landmarks_of_a_linked_scan_are_not_touched(addon, scan_object, reference, tmp_path, overridden):
    from headshop.headshop_addon import scan_landmarks

    scan_landmarks.replace(scan_object, reference.landmark_positions())
    addon.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scan.blend"))
    addon.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with addon.data.libraries.load(str(tmp_path / "scan.blend"), link=True) as (_, wanted):
        wanted.objects = ["Scan"]
    scene, scan = addon.context.scene, wanted.objects[0]
    scene.collection.objects.link(scan)
    if overridden:
        scan = scan.override_create(remap_local_usages=True)
    scene.headshop.scan = scan
    buttons = [getattr(addon.ops.headshop, f"{name}_landmarks") for name in ("find", "click", "load", "clear")]
    assert not any(button.poll() for button in buttons)
    with pytest.raises(RuntimeError, match="linked from another file: make it local first"):
        buttons[-1](name="prn")
    assert addon.ops.headshop.build_head.poll()
    addon.context.view_layer.objects.active = scan
    scan.select_set(True)
    addon.ops.object.make_local(type="SELECT_OBDATA")
    assert all(button.poll() for button in buttons)
    assert buttons[-1](name="prn") == {"FINISHED"} and len(scan_landmarks.to_build(scene.headshop.scan)) == 59
