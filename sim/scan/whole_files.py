# SPDX-License-Identifier: GPL-3.0-or-later
"""Scan files that Blender reads without a word although they are cut off, damaged, or not what their names say."""

import re
import struct
from pathlib import Path

import numpy as np

from ..errors import InputError
from .clean import MOST_TRIANGLES

_TAIL = 4096  # bytes at the end of a text in which its last words stand
_BLOCK = 1 << 24  # bytes of a text that are looked at together


def require_whole(path) -> None:
    """Refuse an STL, GLB or OBJ file that is plainly not whole; others pass.

    Raises
    ------
    InputError : the file is shorter than it says, ends in the middle, has faces of vertices that it lacks, or is of
        another kind.
    """
    path = Path(path)
    check = {".stl": _check_stl, ".glb": _check_glb, ".obj": _check_obj}.get(path.suffix.lower())
    if check is not None:
        check(path, path.stat().st_size)


def _check_stl(path, size):
    """A binary STL has 84 bytes and 50 for each triangle, whatever its first 80 say; a text begins with ``solid``."""
    with path.open("rb") as stream:
        start = stream.read(84)
        stream.seek(max(size - _TAIL, 0))
        end = stream.read().lower()
    count = struct.unpack_from("<I", start, 80)[0] if len(start) == 84 else 0
    wanted = 84 + 50 * count
    if size == wanted:
        return
    if start.lstrip()[:5].lower() == b"solid" and b"\0" not in start:
        if b"endsolid" not in end.rpartition(b"facet")[2].replace(b" ", b""):
            raise InputError(f"{path} is cut off: it does not end with endsolid; copy or export the scan again.")
    elif len(start) < 84 or count > MOST_TRIANGLES:
        raise InputError(f"{path} is not an STL file although it is named so: export the scan again.")
    elif size < wanted:
        raise _cut_off(path, size, wanted)


def _check_glb(path, size):
    with path.open("rb") as stream:
        start = stream.read(12)
    if start[:4] != b"glTF":
        raise InputError(f"{path} is not a GLB file although it is named so: export the scan again.")
    wanted = struct.unpack_from("<I", start, 8)[0] if len(start) == 12 else 12
    if size < wanted:
        raise _cut_off(path, size, wanted)


def _check_obj(path, size):
    """Corners are counted from 1, or from the last vertex, -1, backward."""
    vertices, least, most, none = 0, 0, 0, False
    with path.open("rb") as stream:
        while block := stream.read(_BLOCK) + stream.readline():
            while block.endswith((b"\\\n", b"\\\r\n")):  # the line goes on
                block += stream.readline() or b"\n"
            vertices += len(re.findall(rb"^[ \t]*v\s", block, re.MULTILINE))
            corners = _corners(block)
            if corners is None:
                return  # what Blender makes of it decides
            if len(corners):
                least, most = min(least, corners.min()), max(most, corners.max())
                none |= bool((corners == 0).any())
    if none or most > vertices or least < -vertices:
        raise InputError(f"{path} is damaged, a face names a vertex that does not exist: export the scan again.")


def _corners(block):
    """The vertices (k,) that the faces in a part of an OBJ name; None if some are no numbers."""
    block = block.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    named = b" ".join(re.findall(rb"^[ \t]*f[ \t]([^\r\n#]*)", block, re.MULTILINE))
    try:
        return np.array(re.sub(rb"/\S*", b"", named).split(), dtype=np.int64)
    except (ValueError, OverflowError):
        return None


def _cut_off(path, size, wanted) -> InputError:
    return InputError(f"{path} is cut off: it has {size} bytes of {wanted}; copy or export the scan again.")
