# SPDX-License-Identifier: GPL-3.0-or-later
"""Corrections of found landmarks: the rest follow near by, and the most useful next one is named."""

import json

import numpy as np
import pytest

from headshop.sim.anatomy.landmark_names import SKIN
from headshop.sim.landmarks.correction import follow_corrections, most_useful
from headshop.sim.landmarks.find import FoundLandmarks


@pytest.fixture
def found(reference):
    positions = {n: p for n, p in reference.landmark_positions().items() if n in SKIN}
    confidence = dict.fromkeys(positions, 0.8) | {"ch_l": 0.3, "op": 0.1}
    return FoundLandmarks(positions, confidence, ("op",), ())


def test_what_is_near_follows_and_what_is_far_stays(found):
    places = found.positions
    corrected = {"ch_l": places["ch_l"] + [6.0, 0, 0]}
    moved = follow_corrections(places, found.confidence, corrected)
    assert moved["ch_l"] == pytest.approx(corrected["ch_l"])
    shift = {n: (moved[n] - places[n])[0] for n in places}
    assert shift["li"] > 0.5 and shift["li"] < 6
    assert abs(shift["v"]) < 0.5 * shift["li"] and abs(shift["ex_r"]) < 0.5 * shift["li"]
    assert follow_corrections(places, found.confidence, {}) == places


def test_the_most_useful_landmark_is_unsure_and_far_from_the_corrected(found):
    order = most_useful(found.positions, found.confidence)
    assert sorted(order) == sorted(SKIN)
    assert order.index("ch_l") < order.index("ch_r")
    after = most_useful(found.positions, found.confidence, {"ch_l"})
    assert "ch_l" not in after
    assert after.index("li") > order.index("li")
    sure = most_useful(found.positions, dict.fromkeys(found.positions, 0.9) | {"zy_r": 0.2})
    assert sure[0] == "zy_r"


def test_found_landmarks_live_on_the_scan_apart_from_placed_ones(addon, reference, found):
    from headshop.headshop_addon import bridge, scan_landmarks

    scan = bridge.mesh_to_object(reference.skin, "Scan")
    addon.context.scene.collection.objects.link(scan)
    by_hand = found.positions["prn"] + [1.0, 0, 0]
    scan_landmarks.put(scan, "prn", by_hand)
    scan_landmarks.take_found(scan, found)
    assert set(scan_landmarks.positions(scan)) == {"prn"}
    assert scan_landmarks.positions(scan)["prn"] == pytest.approx(by_hand, abs=1e-3)
    assert len(scan_landmarks.positions(scan, "FOUND")) == 59
    assert "op" not in scan_landmarks.to_build(scan) and len(scan_landmarks.to_build(scan)) == 59
    asked = scan_landmarks.next_to_place(scan)
    assert asked == scan_landmarks.most_useful(scan)[0] != "prn"
    assert scan_landmarks.in_mid_air(scan) == {"op"}
    assert scan_landmarks.most_useful(scan)[-1] == "op", "there is nothing to click"
    assert most_useful(found.positions, found.confidence)[-1] != "op"
    before = scan_landmarks.positions(scan, "FOUND")["cph_l"]
    scan_landmarks.put(scan, "ls", found.positions["ls"] + [0, 0, -5.0])
    scan_landmarks.follow(scan)
    assert scan_landmarks.positions(scan, "FOUND")["cph_l"][2] < before[2] - 0.5
    scan_landmarks.forget(scan)
    assert not scan_landmarks.most_useful(scan) and scan_landmarks.next_to_place(scan) == scan_landmarks.ORDER[0]


def test_the_operator_finds_them_and_refuses_a_ball(addon, reference, one_look):
    from headshop.headshop_addon import bridge, scan_landmarks

    scan = bridge.mesh_to_object(reference.skin, "Scan")
    addon.context.scene.collection.objects.link(scan)
    addon.context.scene.headshop.scan = scan
    assert addon.ops.headshop.find_landmarks() == {"FINISHED"}
    places, truth = scan_landmarks.positions(scan, "FOUND"), reference.landmark_positions()
    assert np.mean([np.linalg.norm(places[n] - truth[n]) for n in places]) < 4.0
    addon.ops.mesh.primitive_uv_sphere_add(radius=0.11)
    addon.context.scene.headshop.scan = addon.context.active_object
    with pytest.raises(RuntimeError, match="No face"):
        addon.ops.headshop.find_landmarks()


def test_a_file_of_found_landmarks_gives_back_the_sure_ones(found, tmp_path):
    from headshop.sim.adapt.landmarks import read_landmarks, write_landmarks

    write_landmarks(tmp_path / "found.json", found.positions, found.missing, found.confidence, found.mid_air)
    assert set(read_landmarks(tmp_path / "found.json")) == set(found.sure())
    assert "op" not in found.sure() and "ch_l" in found.sure()


def test_a_landmark_corrected_in_a_file_is_as_good_as_one_that_was_placed(found, tmp_path):
    from headshop.sim.adapt.landmarks import read_landmark_file, write_landmarks

    path = tmp_path / "found.json"
    write_landmarks(path, found.positions, found.missing, found.confidence, found.mid_air)
    read = read_landmark_file(path)
    assert read.found == {n: found.confidence[n] for n in found.sure()}
    document = json.loads(path.read_text())
    for name in ("prn", "op"):  # the second hung in mid-air
        document["landmarks"][name][2] += 1.5
    path.write_text(json.dumps(document))
    corrected = read_landmark_file(path)
    assert set(corrected.found) == set(read.found) - {"prn"}
    assert set(corrected.positions) == {*read.positions, "op"}
    for broken in ({}, [], 3):  # files of before, and of anybody
        path.write_text(json.dumps(document | {"found": broken}))
        assert "ch_l" in read_landmark_file(path).positions


def test_ears_count_where_some_landmarks_are_sure_and_the_scan_shows_them(reference):
    from headshop.sim.adapt.ears import EAR_MARKS
    from headshop.sim.landmarks.confidence import judge_together
    from headshop.sim.landmarks.shape_fit import REST
    from headshop.sim.landmarks.sure import SURE

    rest = reference.landmark_positions()

    def sure(count):
        confidence = dict.fromkeys(rest, 0.8)
        confidence |= {f"{n}_{side}": 0.1 for side in "lr" for n in EAR_MARKS[count:]}
        judged = judge_together(rest, confidence, (), rest, REST, ("r",))
        return {side: sum(judged[f"{n}_{side}"] >= SURE for n in EAR_MARKS) for side in "lr"}

    assert sure(2) == {"l": 0, "r": 0}
    assert sure(3) == {"l": 3, "r": 0}
    assert sure(6) == {"l": 6, "r": 0}
