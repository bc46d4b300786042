# SPDX-License-Identifier: GPL-3.0-or-later
import json

import numpy as np
import pytest

from headshop.sim.acting.performance import (
    FORMAT,
    Performance,
    performance_from,
    read_performance,
    sample_performance,
    write_performance,
)
from headshop.sim.errors import InputError


def test_easing_hits_keys_and_never_overshoots():
    keys = ((0.0, 0.0), (0.5, 0.2), (1.0, 1.0), (1.5, 1.0), (2.0, 0.0))
    performance = Performance({"jaw_open": keys}, 50.0)
    for t, v in keys:
        assert performance.value("jaw_open", t) == pytest.approx(v)
    curve = np.array([performance.value("jaw_open", t) for t in np.linspace(0, 2, 201)])
    assert curve.min() >= 0 and curve.max() <= 1
    assert np.abs(np.diff(curve)).max() < 0.04  # no jumps
    assert performance.value("jaw_open", 1.25) == pytest.approx(1.0)
    assert performance.frame_count == 101


def test_file_round_trip(tmp_path):
    path = tmp_path / "smile.json"
    write_performance(path, sample_performance())
    again = read_performance(path)
    assert again == sample_performance()
    assert json.loads(path.read_text())["format"] == FORMAT


def test_a_byte_order_mark_is_no_fault(tmp_path):
    path = tmp_path / "smile.json"
    write_performance(path, sample_performance())
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert read_performance(path) == sample_performance()


def test_sample_smile_begins_and_ends_at_rest_and_blinks():
    smile = sample_performance("smile")
    assert 2.0 <= smile.duration <= 3.0 and smile.fps == 24
    for time in (0.0, smile.duration):
        assert all(v == 0 for v in smile.pose(time).values().values())
    poses = smile.frames()
    assert max(p.blink_l for p in poses) > 0.9
    left = np.array([p.muscles["zygomaticus_major_l"] for p in poses])
    right = np.array([p.muscles["zygomaticus_major_r"] for p in poses])
    assert left.max() > right.max() > 0.5 and np.argmax(left > 0.1) <= np.argmax(right > 0.1)


@pytest.mark.parametrize(
    "document, word",
    [
        ([], "format"),
        ({"format": "other"}, "format"),
        *(
            ({"format": FORMAT, "fps": fps, "channels": {"a": [[0, 0]]}}, "from 0.01 to 1000")
            for fps in (0, 1e-7, 1001)
        ),
        ({"format": FORMAT}, "channels"),
        ({"format": FORMAT, "channels": {"a": [[0, "x"]]}}, "pairs"),
        ({"format": FORMAT, "channels": {"a": [[1, 0], [0, 0]]}}, "rise"),
        ({"format": FORMAT, "channels": {"a": [[-1, 0], [0, 0]]}}, "between"),
        ({"format": FORMAT, "channels": {"a": [[0, float("nan")]]}}, "pairs"),
        ({"format": FORMAT, "channels": {"a": [[0, 10**400]]}}, "pairs"),
        ({"format": FORMAT, "fps": 10**400, "channels": {"a": [[0, 0]]}}, "fps"),
    ],
)
def test_bad_documents_say_what_to_do(document, word):
    with pytest.raises(InputError, match=word):
        performance_from(document)


def test_a_channel_given_twice_is_refused(tmp_path):
    path = tmp_path / "p.json"
    path.write_text('{"format": "headshop-performance/1", "channels": {"jaw_open": [[0, 1]], "jaw_open": [[0, 0]]}}')
    with pytest.raises(InputError, match="'jaw_open' twice"):
        read_performance(path)


@pytest.mark.parametrize("name", ["wind_x", "head_z", "gravity_y"])
def test_a_storm_beyond_all_is_refused(name):
    """It became numbers that are none, without a word."""
    with pytest.raises(InputError, match=f"{name}.* within"):
        performance_from({"format": FORMAT, "channels": {name: [[0, 0], [1, -1e30]]}})


def test_bad_files(tmp_path):
    with pytest.raises(InputError, match="no performance file"):
        read_performance(tmp_path / "missing.json")
    (tmp_path / "bad.json").write_text("{")
    with pytest.raises(InputError, match="not a JSON"):
        read_performance(tmp_path / "bad.json")
    (tmp_path / "deep.json").write_text("[" * 100_000)
    with pytest.raises(InputError, match="not a JSON"):
        read_performance(tmp_path / "deep.json")
    with pytest.raises(InputError, match="sample"):
        sample_performance("sneeze")
