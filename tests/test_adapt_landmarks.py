# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmark files and the gate: what is legal is read, each fault gets its own sentence."""

import json
from pathlib import Path

import numpy as np
import pytest

from headshop.sim.adapt.gate import check_against_scan, check_arrangement
from headshop.sim.adapt.landmarks import read_landmark_file, read_landmarks, write_landmarks
from headshop.sim.anatomy.landmark_names import SKIN, mirrored
from headshop.sim.errors import InputError
from headshop.sim.mesh import Mesh

FACE = {
    "n": [0.0, -100.0, 20.0],
    "prn": [0.0, -122.0, -25.0],
    "gn": [0.0, -95.0, -95.0],
    "ex_l": [45.0, -85.0, 12.0],
    "ex_r": [-45.0, -85.0, 12.0],
    "ch_l": [25.0, -95.0, -50.0],
    "ch_r": [-25.0, -95.0, -50.0],
    "t_l": [70.0, 0.0, 0.0],
    "t_r": [-70.0, 0.0, 0.0],
}


def _file(tmp_path, **changes):
    document = {"format": "headshop-landmarks/1", "units": "mm", "landmarks": FACE} | changes
    path = tmp_path / "face.json"
    path.write_text(json.dumps({k: v for k, v in document.items() if v is not ...}))
    return path


def _said(path) -> str:
    with pytest.raises(InputError) as refusal:
        read_landmarks(path)
    sentence = str(refusal.value)
    assert "\n" not in sentence and sentence.endswith(".")
    return sentence


def test_what_is_written_is_read_again(tmp_path):
    path = tmp_path / "out.json"
    write_landmarks(path, {n: np.array(p) for n, p in FACE.items()}, missing=["v", "op"])
    found = read_landmarks(path)
    assert set(found) == set(FACE)
    for name, place in FACE.items():
        np.testing.assert_allclose(found[name], place)
    assert json.loads(path.read_text())["missing"] == ["v", "op"]
    assert [p.name for p in tmp_path.iterdir()] == ["out.json"]


def test_missing_landmarks_are_left_out_and_other_keys_tolerated(tmp_path):
    path = _file(tmp_path, missing=["gn", "v"], sigma_mm={"n": 2.0}, note="by hand")
    assert set(read_landmarks(path)) == set(FACE) - {"gn"}


@pytest.mark.parametrize(("left", "count"), [(0, "none"), (2, "2")])
def test_a_file_of_landmarks_of_which_hardly_one_is_sure_says_so(tmp_path, left, count):
    """It was said to give no landmarks, or two of the nine that it has."""
    names = list(FACE)[left:]
    said = _said(_file(tmp_path, missing=names))
    assert f"has 9 landmarks, of which {count} can be used" in said and "by hand" in said
    confidence = dict.fromkeys(names, 0.05)
    assert said == _said(_file(tmp_path, confidence=confidence, mid_air=[], found={n: FACE[n] for n in names}))
    assert "gives 3 landmarks" in _said(_file(tmp_path, landmarks={n: FACE[n] for n in list(FACE)[:3]}))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"format": ...}, ["no landmark file", "headshop-landmarks/1"]),
        ({"format": "headshop-landmarks/9"}, ["headshop-landmarks/9", "convert"]),
        ({"units": "m"}, ["'m'", "millimetres"]),
        ({"landmarks": [1, 2]}, ['"landmarks"', "at least 4"]),
        ({"missing": "v"}, ['"missing"']),
        ({"landmarks": FACE | {"prn": [1.0, 2.0]}}, ['"prn"', "three numbers"]),
        ({"landmarks": FACE | {"prn": [1.0, 2.0, True]}}, ['"prn"', "three numbers"]),
        ({"landmarks": FACE | {"prn": [1.0, 2.0, float("nan")]}}, ['"prn"', "finite"]),
        ({"landmarks": FACE | {"prn": [1.0, 2.0, 10**400]}}, ['"prn"', "finite"]),
        ({"landmarks": FACE | {"n": FACE["prn"]}}, ["same place"]),
        ({"landmarks": dict(list(FACE.items())[:3])}, ["3 landmarks", "at least 4"]),
        ({"landmarks": {n: [p[0], 0.0, p[2]] for n, p in FACE.items()}}, ["in one plane", "prn"]),
        ({"landmarks": {n: FACE[n] for n in ("n", "prn", "gn")} | {"v": [0.0, 0.0, 120.0]}}, ["one plane", "ex_l"]),
        ({"landmarks": FACE | {"pronasale": [0.0, 0.0, 0.0]}}, ['"pronasale"', '"prn"']),
        ({"landmarks": FACE | {"ex_left": [0.0, 0.0, 0.0]}}, ['"ex_left"', '"ex_l"']),
        ({"landmarks": FACE | {"qqqqqq": [0.0, 0.0, 0.0]}}, ['"qqqqqq"', SKIN[0]]),
    ],
)
def test_each_fault_has_its_sentence(tmp_path, changes, words):
    sentence = _said(_file(tmp_path, **changes))
    for word in words:
        assert word in sentence


def test_files_that_are_none(tmp_path):
    assert "no landmark file" in _said(tmp_path / "nowhere.json")
    text = tmp_path / "letter.json"
    text.write_text("Dear scanner,")
    assert "no JSON" in _said(text)
    binary = tmp_path / "binary.json"
    binary.write_bytes(b"\xff\xfe\x00\x81" * 20)
    assert "cannot be read" in _said(binary)
    assert "cannot be read" in _said(tmp_path)
    twice = tmp_path / "twice.json"
    twice.write_text('{"format": "headshop-landmarks/1", "landmarks": {"n": [0, 0, 0], "n": [1, 1, 1]}}')
    assert '"n" twice' in _said(twice)


def test_a_confidence_beyond_every_number_is_none(tmp_path):
    path = _file(tmp_path, confidence={"prn": 10**400}, mid_air=[])
    assert read_landmark_file(path).found == {}


def _points(scale=1.0, shift=(0, 0, 0)):
    return {n: np.array(p) * scale + shift for n, p in FACE.items()}


def _ball():
    """A scan about the size and place of the face: a sphere of 110 mm."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 40), np.linspace(0.05, np.pi - 0.05, 30))
    points = 110 * np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1).reshape(-1, 3)
    i = np.arange(1200).reshape(30, 40)
    quads = np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]], axis=-1).reshape(-1, 4).astype(np.int32)
    return Mesh(points, quads)


def test_landmarks_must_lie_on_the_scan():
    scan = _ball()
    check_against_scan(_points(), scan)
    for changed, word in (
        (_points(0.001), "metres"),
        (_points(0.1), "centimetres"),
        (_points(shift=(0, 0, 400.0)), "mm from the scan"),
        (_points(1000.0), "same units"),
    ):
        with pytest.raises(InputError, match=word):
            check_against_scan(changed, scan)


def test_a_landmark_in_mid_air_is_no_fault():
    scan = _ball()
    far = _points() | {"v": np.array([0.0, 20.0, 190.0])}
    check_against_scan(far, scan)


def test_arrangements_that_are_no_face():
    reference = _points()
    given = {n: p * 0.9 + np.array([5.0, 2.0, 1.0]) for n, p in reference.items()}
    check_arrangement(reference, given)
    swapped = {mirrored(n): p for n, p in given.items()}
    pair = given | {"ch_l": given["ch_r"], "ch_r": given["ch_l"]}
    lost = given | {"prn": given["prn"] + [0.0, 0.0, 80.0]}
    rng = np.random.default_rng(1)
    nonsense = {n: rng.normal(0, 80, 3) for n in given}
    tiny = {n: p * 0.2 for n, p in given.items()}
    for changed, word in (
        (swapped, "left and right are exchanged"),
        (pair, '"ch_l" and "ch_r" are exchanged'),
        (lost, '"prn"'),
        (nonsense, "check|place"),
        (tiny, "times the size"),
    ):
        with pytest.raises(InputError, match=word):
            check_arrangement(reference, changed)


def test_every_landmark_is_documented():
    text = (Path(__file__).resolve().parents[1] / "docs" / "landmarks.md").read_text()
    bases = {name.removesuffix("_l").removesuffix("_r") for name in SKIN}
    assert [name for name in bases if f"| `{name}` |" not in text] == []
