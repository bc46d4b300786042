# SPDX-License-Identifier: GPL-3.0-or-later
"""The size of a scan in the window: told in a unit of its own, or guessed from the face when the landmarks are found."""

import json

import numpy as np
import pytest

from headshop.sim.landmarks import find
from headshop.sim.landmarks.find import FoundLandmarks
from headshop.sim.progress import Progress
from headshop.sim.scan.ply import write_ply
from headshop.sim.scan.units import BY_FACE


def _facts(obj):
    from headshop.headshop_addon import heads

    return json.loads(obj[heads.REPORT])["scan"]


@pytest.fixture
def imported(addon, reference, tmp_path):
    """``imported(mm, **options)`` -> the object of a scan of the reference in units of so many mm."""

    def make(mm, **options):
        path = tmp_path / "scan.ply"
        write_ply(path, reference.skin.moved(reference.skin.vertices / mm))
        assert addon.ops.headshop.import_scan(filepath=str(path), **options) == {"FINISHED"}
        return addon.context.scene.headshop.scan

    return make


def _extent(obj):
    """m across the mesh."""
    return max(np.ptp([tuple(v.co) for v in obj.data.vertices], axis=0))


@pytest.mark.parametrize(
    ("unit", "options", "name", "told"),
    [
        (70.0, {"unit": "OTHER", "unit_mm": 70.0}, "custom", True),
        (10.0, {"unit": "cm"}, "cm", True),
        (10.0, {}, "cm", False),
        (70.0, {}, BY_FACE, False),
    ],
)
def test_a_scan_comes_in_in_its_own_unit(imported, reference, unit, options, name, told):
    scan = imported(unit, **options)
    assert _extent(scan) == pytest.approx(
        np.ptp(reference.skin.vertices, axis=0).max() / 1000, rel=1e-3 if told else 0.04
    )
    facts = _facts(scan)
    assert (facts["unit"], facts["unit_told"]) == (name, told)
    assert facts["unit_scale"] == pytest.approx(unit, rel=1e-6 if name in ("cm", "custom") else 0.04)


@pytest.mark.parametrize("bad", [2.0, 12.0])
def test_a_find_that_is_unlike_faces_is_told(addon, imported, monkeypatch, capfd, bad):
    imported(1000.0)

    def found(mesh, any_size=False, usual=()):
        yield Progress(0.5, "")
        return FoundLandmarks({"prn": np.zeros(3)}, {"prn": 0.9}, (), (), 1.0, bad)

    monkeypatch.setattr(find, "find_landmarks", found)
    assert addon.ops.headshop.find_landmarks() == {"FINISHED"}
    assert ("unlike most faces" in capfd.readouterr().out) == (bad > 7)


def test_a_scan_of_no_persons_size_becomes_one_with_its_landmarks(addon, imported, reference, monkeypatch):
    from headshop.headshop_addon import scan_landmarks

    scan, asked = imported(10.0), []
    places = {n: 0.5 * p for n, p in reference.landmark_positions().items() if n in ("prn", "gn", "n", "en_l")}

    def found(mesh, any_size=False, usual=()):
        asked.append(any_size)
        yield Progress(0.5, "")
        return FoundLandmarks(places, dict.fromkeys(places, 0.9), (), (), 0.5, 1.0)

    monkeypatch.setattr(find, "find_landmarks", found)
    scan_landmarks.put(scan, "sto", [2.0, -90.0, 40.0])
    before = _extent(scan)
    assert addon.ops.headshop.find_landmarks() == {"FINISHED"}
    assert asked == [True]
    assert _extent(scan) == pytest.approx(0.5 * before, rel=1e-5)
    assert scan_landmarks.positions(scan, "PLACED")["sto"] == pytest.approx([1.0, -45.0, 20.0], abs=1e-3)
    assert scan_landmarks.positions(scan, "FOUND")["prn"] == pytest.approx(places["prn"], abs=1e-3)
    assert _facts(scan)["unit"] == BY_FACE and _facts(scan)["unit_scale"] == pytest.approx(5.0)
    assert "units of 5 mm" in _facts(scan)["orientation"]
    told = imported(10.0, unit="cm")
    monkeypatch.setattr(find, "find_landmarks", lambda mesh, any_size=False, **_: asked.append(any_size) or found(mesh))
    addon.ops.headshop.find_landmarks()
    assert told is not scan and asked[1] is False


def test_a_room_that_was_read_as_a_head_in_inches_is_one_in_metres(addon, imported, monkeypatch):
    """A scan of 4 m is 4 inches across as well, a face's size; which of the two it is its face tells."""
    scan, offered = imported(25.4), []
    assert _facts(scan)["unit"] == "in"
    metres = 1000 / 25.4

    def found(mesh, any_size=False, usual=()):
        offered.extend(usual)
        yield Progress(0.5, "")
        return FoundLandmarks({"prn": np.zeros(3)}, {"prn": 0.9}, (), (), metres, 1.0)

    monkeypatch.setattr(find, "find_landmarks", found)
    before = _extent(scan)
    assert addon.ops.headshop.find_landmarks() == {"FINISHED"}
    assert sorted(offered) == pytest.approx([1 / 25.4, 10 / 25.4, 1.0, metres])
    assert _extent(scan) == pytest.approx(metres * before, rel=1e-5)
    assert _facts(scan)["unit"] == "m" and _facts(scan)["orientation"] == "Read as metres."
