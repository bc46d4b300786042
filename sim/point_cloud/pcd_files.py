# SPDX-License-Identifier: GPL-3.0-or-later
"""Points in PCD files of the Point Cloud Library, as Open3D and depth cameras' programs write them: text and binary."""

from pathlib import Path

import numpy as np

from ..errors import InputError
from ..file_bytes import file_bytes
from ..mesh import Mesh

#: What a header may take.
HEAD = 1 << 14
_TYPES = {"F": "f", "U": "u", "I": "i"}


def read_pcd(path) -> Mesh:
    """The points of a PCD file, in its own unit, as a mesh without faces; with colours (``rgb`` or ``rgba``) and normals.

    Raises
    ------
    InputError : the file cannot be read, is no PCD, is cut off, compressed, or has no points.
    """
    path = Path(path)
    data = file_bytes(path)
    header, start = _header(data, path)
    columns = _columns(data[start:], header, path)
    if any(axis not in columns for axis in "xyz") or not len(columns["x"]):
        raise InputError(f"{path} has no points: export the scan again.")
    normals = ("normal_x", "normal_y", "normal_z")
    return Mesh(
        np.stack([columns[axis] for axis in "xyz"], axis=1).astype(np.float64),
        np.zeros((0, 4), np.int32),
        colour=_colour(columns),
        normals=_stacked(columns, normals) if all(name in columns for name in normals) else None,
    )


def _header(data, path) -> tuple[dict, int]:
    """The words after each keyword, and where the points begin."""
    header, at = {}, 0
    for line in data[:HEAD].splitlines(keepends=True):
        at += len(line)
        words = line.decode("ascii", "replace").split()
        if words and not words[0].startswith("#"):
            header[words[0].upper()] = words[1:]
        if words and words[0].upper() == "DATA":
            break
    if not header.get("DATA") or not header.get("FIELDS"):
        raise InputError(f"{path} is not a PCD file, or its header is damaged: export the scan again.")
    return header, at


def _columns(body, header, path) -> dict[str, np.ndarray]:
    """Values (n,) of each field of one number, by its name."""
    names = header["FIELDS"]
    counts = header.get("COUNT", ["1"] * len(names))
    try:
        types = [_TYPES[kind] + size for kind, size in zip(header["TYPE"], header["SIZE"], strict=True)]
        row = np.dtype([(f"{k}", kind, (int(n),)) for k, (kind, n) in enumerate(zip(types, counts, strict=True))])
        points = int(header["POINTS"][0]) if "POINTS" in header else int(header["WIDTH"][0]) * int(header["HEIGHT"][0])
        names = dict(zip(names, row.names, strict=True))
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise InputError(f"{path} has a damaged header: export the scan again.") from error
    table = _rows(body, header["DATA"][0].lower(), row, points, path)
    return {name: table[field][:, 0] for name, field in names.items() if table[field].shape[1] == 1}


def _rows(body, encoding, row, points, path):
    if points < 0:
        raise InputError(f"{path} has a damaged header: export the scan again.")
    if encoding == "binary":
        if len(body) < points * row.itemsize:
            raise _cut_off(path)
        return np.frombuffer(body, row, points)
    if encoding != "ascii":
        raise InputError(f"{path} is a compressed PCD file: write it uncompressed, or as PLY.")
    width = sum(row[name].shape[0] for name in row.names)
    try:
        numbers = np.array(body.split(), dtype=np.float64)
    except ValueError as error:
        raise InputError(
            f"{path} is damaged, there is something that is no number in it: export the scan again."
        ) from error
    if len(numbers) < points * width:
        raise _cut_off(path)
    numbers, table, at = numbers[: points * width].reshape(points, width), np.empty(points, row), 0
    for name in row.names:
        step = row[name].shape[0]
        table[name] = numbers[:, at : at + step]
        at += step
    return table


def _colour(columns):
    """(n, 3) 0..1: blue, green and red are the bytes of one number, which may be called a float."""
    packed = next((columns[name] for name in ("rgb", "rgba") if name in columns), None)
    if packed is None or packed.dtype.itemsize != 4:
        return None
    parts = np.ascontiguousarray(packed).view(np.uint32)
    return np.stack([(parts >> shift) & 255 for shift in (16, 8, 0)], axis=1).astype(np.float32) / np.float32(255)


def _stacked(columns, names):
    return np.stack([columns[name] for name in names], axis=1).astype(np.float32)


def _cut_off(path) -> InputError:
    return InputError(f"{path} is truncated, its end is missing: copy or export it again.")
