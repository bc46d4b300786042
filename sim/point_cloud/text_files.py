# SPDX-License-Identifier: GPL-3.0-or-later
"""Points in text files, one to a line: XYZ, PTS, ASC, CSV and plain text, as scanners and CloudCompare write them."""

from pathlib import Path

import numpy as np

from ..errors import InputError
from ..file_bytes import file_bytes
from ..mesh import Mesh

EXTENSIONS = (".xyz", ".xyzrgb", ".xyzn", ".pts", ".asc", ".csv", ".txt")
HEAD = 1 << 14  # bytes at the start in which the first point must stand
#: Normals are of length 1 to this much, on average.
UNIT = 0.05


def read_points(path) -> Mesh:
    """The points of a text file, in its own unit, as a mesh without faces.

    A line has x, y and z, parted by blanks, tabs, commas or semicolons, and then what may be known of the point: an intensity,
    which is passed over, red, green and blue, 0 to 1, 0 to 255 or of 16 bits, and a normal, in any order. Lines with fewer
    numbers, as those with names or with how many points follow, are passed over.

    Raises
    ------
    InputError : the file cannot be read or has no points.
    """
    path = Path(path)
    data = file_bytes(path)
    return _as_cloud(_table(data, path))


def _table(data: bytes, path) -> np.ndarray:
    """(n, c) the numbers of all lines that have as many as the first point."""
    if b";" in data[:HEAD]:  # such files write 1,5 for one and a half, if they have any comma
        data = data.replace(b",", b".")
    for mark in (b",", b";", b"\t", b'"'):
        data = data.replace(mark, b" ")
    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n").strip()
    columns = next((count for count in map(_numbers, data[:HEAD].splitlines()) if count >= 3), 0)
    if not columns:
        raise _none(path)
    lines = data.count(b"\n") + 1
    try:  # far faster than line by line
        flat = np.array(data.split(), dtype=np.float64)
    except ValueError:
        flat = np.zeros(0)
    if len(flat) != lines * columns:
        flat = np.array(b" ".join(line for line in data.splitlines() if _numbers(line) == columns).split(), np.float64)
    return flat.reshape(-1, columns)


def _numbers(line: bytes) -> int:
    """How many numbers a line has, 0 if there is anything else in it."""
    words = line.split()
    try:
        for word in words:
            float(word)
    except ValueError:
        return 0
    return len(words)


def _as_cloud(table) -> Mesh:
    """A table (n, c) of lines as a mesh without faces."""
    rest = table[:, 3:]
    normals = next((k for k in range(rest.shape[1] - 2) if _are_normals(rest[:, k : k + 3])), None)
    pieces = [rest] if normals is None else [rest[:, :normals], rest[:, normals + 3 :]]
    colour = next((_colours(piece) for piece in pieces if piece.shape[1] >= 3), None)
    return Mesh(
        table[:, :3],
        np.zeros((0, 4), np.int32),
        colour=colour,
        normals=None if normals is None else rest[:, normals : normals + 3].astype(np.float32),
    )


def _are_normals(three) -> bool:
    """Whether three columns are of length 1; a grey of .58 is too, but no normals point all one way."""
    length = np.linalg.norm(three, axis=1)
    some = length > 0
    return bool(some.any() and np.abs(length[some] - 1).mean() < UNIT and (three < 0).any())


def _colours(columns):
    """Red, green and blue (n, 3), 0 to 1, of three columns or more: the last three, as an intensity comes first, unless it is
    seen to come last because it alone is no whole number."""
    whole = (columns == np.rint(columns)).all(axis=0)
    three = columns[:, :3] if whole[:3].all() and not whole[-1] else columns[:, -3:]
    most = np.nanmax(three, initial=0.0)
    full = 1.0 if most <= 1 else 255.0 if most <= 255 else 65535.0
    return np.clip(np.nan_to_num(three) / full, 0, 1).astype(np.float32)


def _none(path) -> InputError:
    return InputError(
        f"{path} has no points, lines of three numbers or more: export the scan again, as PLY if you can."
    )
