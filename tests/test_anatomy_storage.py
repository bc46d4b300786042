# SPDX-License-Identifier: GPL-3.0-or-later
"""A head as a file: what comes back, and what is said of files that are none."""

import numpy as np
import pytest

from headshop.sim.acting import arkit, expressions
from headshop.sim.anatomy.storage import REFERENCE, load_head, save_head
from headshop.sim.errors import InputError
from headshop.sim.relax import movement, responses
from headshop.sim.tissue.model import strengths


def test_a_head_comes_back_as_it_was(reference, tmp_path):
    save_head(reference, tmp_path / "head.npz")
    again = load_head(tmp_path / "head.npz")
    for name, mesh in reference.parts.items():
        np.testing.assert_array_equal(again.parts[name].vertices, mesh.vertices)
    assert [m.name for m in again.muscles] == [m.name for m in reference.muscles]


def test_a_file_that_is_no_head_is_told(tmp_path):
    whole = REFERENCE.read_bytes()
    half = len(whole) // 2
    np.savez(tmp_path / "other.npz", points=np.zeros(3))
    np.save(tmp_path / "array.npy", np.zeros(3))
    for name, data in {"letter": b"hi there", "empty": b"", "cut": whole[:half]}.items():
        (tmp_path / f"{name}.npz").write_bytes(data)
    (tmp_path / "torn.npz").write_bytes(whole[:half] + b"x" * 99 + whole[half + 99 :])
    for path in tmp_path.iterdir():
        with pytest.raises(InputError, match=f"{path.name} is no head"):
            load_head(path)
    for path in (tmp_path / "nowhere.npz", tmp_path):
        with pytest.raises(InputError, match="cannot be read"):
            load_head(path)


def test_a_head_that_cannot_be_written_is_told(reference, tmp_path):
    for path in (tmp_path / "nowhere" / "head.npz", tmp_path):
        with pytest.raises(InputError, match=f"{path} cannot be written"):
            save_head(reference, path)
    assert not list(tmp_path.iterdir())


def test_parts_that_it_lacks_and_counts_that_it_has_not_are_refused(reference):
    with pytest.raises(InputError, match="no part 'nose'"):
        reference.with_vertices({"nose": np.zeros((3, 3))})
    with pytest.raises(InputError, match="cannot take positions"):
        reference.with_vertices({"skin": np.zeros((3, 3))})


READERS = (expressions.expressions, arkit.poses, arkit.over, strengths)


@pytest.mark.parametrize(
    "read", (*READERS, responses.responses, movement.read_movement), ids=lambda read: read.__name__
)
def test_a_table_that_is_not_there_is_told(read, tmp_path):
    for path in (tmp_path / "nowhere.json", tmp_path):
        with pytest.raises(InputError, match=f"{path} cannot be read"):
            read(path)


@pytest.mark.parametrize("read", READERS, ids=lambda read: read.__name__)
def test_a_table_of_something_else_is_told(read, tmp_path):
    path = tmp_path / "table.json"
    for text in ("{", "[]", "{}", '{"expressions": 3, "shapes": 3, "over": 3, "muscles": 3}', "\x80"):
        path.write_text(text, encoding="latin-1")
        with pytest.raises(InputError, match="table.json is no table with"):
            read(path)
    if read is arkit.over:
        path.write_bytes(b'\xef\xbb\xbf{"over": {}}')  # with a byte order mark
        assert read(path) == {}
