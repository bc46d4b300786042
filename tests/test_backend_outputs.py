# SPDX-License-Identifier: GPL-3.0-or-later
"""Outputs appear whole or not at all; motions compress to few shapes."""

import errno
import os
from pathlib import Path

import numpy as np
import pytest

from headshop.headshop_addon.outputs import Outputs
from headshop.sim.acting.principal import principal_shapes
from headshop.sim.anatomy import storage
from headshop.sim.errors import InputError


def test_all_files_appear_in_the_end(tmp_path):
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "b.txt").write_text("from an earlier run")
    with Outputs() as outputs:
        outputs.file(tmp_path / "new" / "deep" / "a.txt").write_text("a")
        (outputs.folder(tmp_path / "old", ["a.txt", "b.txt"]) / "a.txt").write_text("fresh")
        assert not (tmp_path / "new" / "deep" / "a.txt").exists()
    assert sorted(p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*")) == [
        *("new", "new/deep", "new/deep/a.txt", "old", "old/a.txt")
    ]


def test_what_lies_beside_a_file_goes_along_and_spares_what_is_there(tmp_path):
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "own.png").write_text("somebody's own")
    for kind in ("first", "second"):
        with Outputs() as outputs:
            file = outputs.file(tmp_path / "a.txt", "pictures")
            file.write_text(kind)
            (file.parent / "pictures").mkdir()
            (file.parent / "pictures" / "skin.png").write_text(kind)
    assert {p.name: p.read_text() for p in tmp_path.rglob("*.*")} == {
        **{"a.txt": "second", "own.png": "somebody's own", "skin.png": "second"}
    }
    with Outputs() as outputs:
        outputs.file(tmp_path / "b.txt", "b_pictures").write_text("without any")
    assert not (tmp_path / "b_pictures").exists()
    with pytest.raises(InputError, match="a.txt must be a folder"), Outputs() as outputs:
        outputs.file(tmp_path / "c.txt", "a.txt")


def test_nothing_is_left_of_an_interruption(tmp_path):
    (tmp_path / "old.txt").write_text("old")
    with pytest.raises(KeyboardInterrupt), Outputs() as outputs:
        outputs.file(tmp_path / "old.txt").write_text("half")
        outputs.file(tmp_path / "new" / "a.txt").write_text("half")
        raise KeyboardInterrupt
    assert [p.name for p in tmp_path.rglob("*")] == ["old.txt"]
    assert (tmp_path / "old.txt").read_text() == "old"


def test_a_place_that_cannot_be_written_is_refused_at_once(tmp_path):
    (tmp_path / "file").write_text("")
    for place in (tmp_path / "file" / "a.txt", tmp_path):
        with pytest.raises(InputError, match="give"), Outputs() as outputs:
            outputs.file(place)
    assert [p.name for p in tmp_path.rglob("*")] == ["file"]


def test_inputs_are_spared(tmp_path):
    given = tmp_path / "landmarks.json"
    given.write_text("picked by hand")
    (tmp_path / "link.json").symlink_to(given)
    for begin in (
        lambda outputs: outputs.file(tmp_path / "link.json"),
        lambda outputs: outputs.folder(tmp_path / ".", ["skin.ply", "landmarks.json"]),
    ):
        with pytest.raises(InputError, match="is an input"), Outputs((given, None)) as outputs:
            begin(outputs)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["landmarks.json", "link.json"]
    assert given.read_text() == "picked by hand"


def test_a_link_stays_one(tmp_path):
    """A head that is kept elsewhere was not baked: the link to it became a file."""
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / "head.blend").write_text("old")
    for name, to in (("link.blend", "store/head.blend"), ("dangling.blend", "later/head.blend")):
        (tmp_path / name).symlink_to(tmp_path / to)
        with Outputs() as outputs:
            file = outputs.file(tmp_path / name)
            assert file.name == name
            file.write_text("new")
        assert (tmp_path / name).is_symlink() and (tmp_path / to).read_text() == "new"
        assert [p.name for p in (tmp_path / to).parent.iterdir()] == ["head.blend"]


def test_what_cannot_be_renamed_in_the_end_is_told(tmp_path, monkeypatch):
    """Others' files in a folder in which nobody replaces others' are an example: it was our fault, in a hidden folder."""

    def refused(old, new):
        raise PermissionError(errno.EPERM, "Operation not permitted", str(old))

    monkeypatch.setattr(os, "replace", refused)
    with (
        pytest.raises(InputError, match=f"^{tmp_path}/a.txt cannot be written .Operation not permitted"),
        Outputs() as outputs,
    ):
        outputs.file(tmp_path / "a.txt").write_text("a")
    assert not list(tmp_path.iterdir())


def test_names_too_long_or_through_what_is_not_there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for begin in (lambda outputs: outputs.file("x" * 256), lambda outputs: outputs.folder("x" * 256, ["a.txt"])):
        with pytest.raises(InputError, match="cannot be written .File name too long"), Outputs() as outputs:
            begin(outputs)
    longest = tmp_path / ("x" * 250 + ".json")
    storage.write_atomically(longest, b"whole")
    assert longest.read_bytes() == b"whole" and len(list(tmp_path.iterdir())) == 1
    for path in (tmp_path / "nowhere" / ".." / "a.txt", tmp_path / "loop.txt"):
        (tmp_path / "loop.txt").unlink(missing_ok=True)
        (tmp_path / "loop.txt").symlink_to("loop.txt")
        with Outputs((longest,)) as outputs:
            outputs.file(path).write_text("new")
        assert path.read_text() == "new"


def test_two_runs_may_make_the_same_folder_at_once(tmp_path, monkeypatch):
    """The second was told that nothing can be written to a folder that exists."""
    make = Path.mkdir

    def late(path):
        os.mkdir(path)  # the other run's
        make(path)

    monkeypatch.setattr(Path, "mkdir", late)
    with Outputs() as outputs:
        outputs.file(tmp_path / "new" / "deep" / "a.txt").write_text("a")
    assert (tmp_path / "new" / "deep" / "a.txt").read_text() == "a"
    with pytest.raises(KeyboardInterrupt), Outputs() as outputs:
        outputs.file(tmp_path / "theirs" / "a.txt").write_text("half")
        raise KeyboardInterrupt
    assert (tmp_path / "theirs").is_dir() and not list((tmp_path / "theirs").iterdir())


def test_a_full_disk_is_told_with_the_name_that_was_given(tmp_path, monkeypatch):
    """It was that of a hidden folder, which is gone by then."""

    def full(path, data):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(storage, "_write_beside", full)
    monkeypatch.chdir(tmp_path)
    for begin, told in (
        (lambda outputs: outputs.file("found.json"), "found.json"),
        (
            lambda outputs: outputs.folder(tmp_path / "plain", ["skin.ply"]) / "skin.ply",
            tmp_path / "plain" / "skin.ply",
        ),
    ):
        with pytest.raises(InputError) as refusal, Outputs() as outputs:
            storage.write_atomically(begin(outputs), b"data")
        assert str(refusal.value).startswith(f"{told} cannot be written (No space left on device): is the disk full")
    with pytest.raises(InputError, match="^The scan has no faces"), Outputs() as outputs:
        outputs.file("found.json")
        raise InputError("The scan has no faces.")
    assert not list(tmp_path.iterdir())


def test_a_file_and_a_folder_of_one_name_are_refused(tmp_path):
    with pytest.raises(InputError, match="head is a file"), Outputs() as outputs:
        outputs.file(tmp_path / "head")
        outputs.folder(tmp_path / "head", ["skin.ply"])
    assert not list(tmp_path.iterdir())


def test_a_rigid_motion_needs_at_most_twelve_shapes():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(300, 3)) * 50
    motion = np.empty((60, 300, 3))
    for k in range(60):
        rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        motion[k] = points @ rotation.T + rng.normal(size=3) - points
    found = principal_shapes(motion, 0.001)
    assert len(found.shapes) == 12
    assert np.linalg.norm(np.einsum("fk,kni->fni", found.weights, found.shapes) - motion, axis=2).max() <= 0.001
    np.testing.assert_allclose(np.abs(found.weights).max(axis=0), 1)


def test_the_fewest_shapes_within_the_tolerance():
    rng = np.random.default_rng(1)
    strong = np.einsum("fk,kni->fni", rng.normal(size=(40, 3)), rng.normal(size=(3, 100, 3)))
    weak = 1e-5 * rng.normal(size=(40, 100, 3))
    found = principal_shapes(strong + weak, 0.001)
    assert len(found.shapes) == 3 and 0 < found.error <= 0.001
    assert len(principal_shapes(strong + weak, 1e-9).shapes) == 40
    assert len(principal_shapes(np.zeros((5, 10, 3)), 0.001).shapes) == 0
