# SPDX-License-Identifier: GPL-3.0-or-later
"""The header of a PLY file: which elements follow, with which properties, and which pictures it names."""

import re
from dataclasses import dataclass, field

from ..errors import InputError

#: Type names of the header -> numpy types.
TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"},
    **{"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"},
}


@dataclass(frozen=True)
class Property:
    """One column: ``type`` as numpy spells it, ``count_type`` too for a list, else None."""

    name: str
    type: str
    count_type: str | None = None


@dataclass
class Element:
    """``count`` rows of ``properties``."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)

    @property
    def least_bytes(self) -> int:
        """The fewest bytes that one row can take (in ASCII: a digit and a blank per property)."""
        return max(1, len(self.properties))


@dataclass(frozen=True)
class Header:
    """``encoding`` and ``elements`` of a file, the names of its ``pictures``, and ``start``, the offset of the body."""

    encoding: str
    elements: list[Element]
    pictures: tuple[str, ...]
    start: int


def read_header(data: bytes, path) -> Header:
    """What the header says; a picture is what ``comment TextureFile NAME`` names, as MeshLab, Metashape and others write it.

    Raises
    ------
    InputError : the file is empty, not PLY, its header is damaged, or it promises more rows than its size can hold.
    """
    if not data.strip():
        raise InputError(f"{path} is empty: choose another file, or export the scan again.")
    if data[:3] != b"ply" or data[3:4] not in (b"\n", b"\r", b" "):
        raise InputError(f"{path} is not a PLY file although its name says so: choose a scan, or rename the file.")
    mark = data.find(b"end_header")
    if mark < 0:
        raise InputError(f"{path} is truncated within its header: copy or export it again.")
    start = mark + len(b"end_header")
    start += 2 if data[start : start + 2] == b"\r\n" else 1
    encoding, elements, pictures = None, [], []
    # not `str.splitlines`: bytes of a name in UTF-8 may look like further ends of lines
    for line in re.split(r"[\r\n]+", data[:mark].decode("latin-1")):
        words = line.split()
        try:
            if not words:
                continue
            if words[0] == "format":
                encoding = words[1]
            elif [word.lower() for word in words[:2]] == ["comment", "texturefile"] and len(words) > 2:
                pictures.append(_name(line.split(maxsplit=2)[2]))
            elif words[0] == "element":
                elements.append(Element(words[1], int(words[2])))
            elif words[0] == "property" and words[1] == "list":
                elements[-1].properties.append(Property(words[4], TYPES[words[3]], TYPES[words[2]]))
            elif words[0] == "property":
                elements[-1].properties.append(Property(words[2], TYPES[words[1]]))
        except (IndexError, KeyError, ValueError) as error:
            raise InputError(
                f"{path} has a damaged header (the line {line.strip()[:60]!r}): export the scan again."
            ) from error
    if encoding not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise InputError(f"{path} has an unknown encoding ({encoding}): export it as binary PLY.")
    left = len(data) - start
    for element in elements:
        if element.count < 0 or element.count * element.least_bytes > max(left, 0):
            raise InputError(
                f"{path} promises {element.count} of '{element.name}' but is only {len(data)} bytes long: it is "
                "damaged or truncated, copy or export it again."
            )
    return Header(encoding, elements, tuple(pictures), start)


def _name(latin: str) -> str:
    """A name as it is meant: in UTF-8, or else in Latin-1 as it was read."""
    try:
        return latin.strip().encode("latin-1").decode("utf-8")
    except UnicodeDecodeError:
        return latin.strip()
