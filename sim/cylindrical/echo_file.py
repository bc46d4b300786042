# SPDX-License-Identifier: GPL-3.0-or-later
"""Cyberware's range files, as the scanner's program Echo writes them, with their colour file.

A text header of ``NAME=value`` lines from ``Cyberware Digitizer Data`` to ``DATA=``, or an older binary one of 114, 122
or 128 bytes; then ``NLG`` longitudes of ``NLT`` radii from the bottom up, 16 bits, big-endian, micrometres shifted right
by ``RSHIFT``; -32768 is void. ``LTINCR`` is in micrometres, ``LGINCR`` in microradians. Longitude grows toward the
subject's right and is half a turn at the front, unless ``THETA_RIGHTHAND`` is set. The colours are an SGI image of the
same longitudes and latitudes in ``NAME.color``.
"""

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from .range_map import TURN, RangeMap

START, END = b"Cyberware", b"DATA=\n"
VOID = -32768
_NEEDED = ("NLT", "NLG", "LTINCR", "LGINCR", "RSHIFT")
#: Older headers by the offset of the data they give: how the compilers of their machines laid the fields out.
_OLD = {
    122: ">4xI40x10x4h3i8x4x4h",
    114: ">4xI40x10x4h3i8x4x4h",
    128: ">4xI40x10x4h2x3i8x4x4h",
}
_CARTESIAN, _RIGHTHAND = 0x100, 0x1000
#: Sizes that no scanner exceeds.
_MOST = 8192


def is_echo(data: bytes) -> bool:
    """Whether a file that begins with ``data`` (128 bytes or more) is one of these."""
    return data.startswith(START) or (len(data) >= 8 and int.from_bytes(data[4:8], "big") in _OLD)


def parse_echo(data: bytes, name: str, image: np.ndarray | None = None) -> RangeMap:
    """The map in an Echo file, with the colours of ``image`` (h, w, 3), whose columns are the file's longitudes.

    Raises
    ------
    InputError : no such file, cut off, flat (Cartesian), or with a header that makes no sense.
    """
    fields, start = _text_header(data, name) if data.startswith(START) else _binary_header(data, name)
    nlt, nlg, shift = fields["NLT"], fields["NLG"], fields["RSHIFT"]
    if fields["SPACE"] != "CYLINDRICAL":
        raise InputError(f"{name} is a flat range image, not one taken around a head: export the scan as a mesh (PLY).")
    sane = 1 < nlt <= _MOST and 2 < nlg <= _MOST and 0 <= shift <= 15
    if not sane or fields["LTINCR"] <= 0 or fields["LGINCR"] == 0:
        raise InputError(f"{name} has a header that makes no sense ({nlg} x {nlt} radii): export the scan again.")
    if len(data) - start < 2 * nlt * nlg:
        raise InputError(
            f"{name} is cut off: it holds {(len(data) - start) // 2} radii of {nlt * nlg}; copy or export it again."
        )
    raw = np.frombuffer(data, ">i2", nlt * nlg, start).reshape(nlg, nlt)
    valid = raw > 0  # what lies on the axis is void too
    lt, lg = np.arange(nlt), np.arange(nlg)
    valid &= (lg >= fields["LGMIN"])[:, None] & (lg <= fields["LGMAX"])[:, None]
    valid &= (lt >= fields["LTMIN"]) & (lt <= fields["LTMAX"])
    if not valid.any():
        raise InputError(f"{name} holds no radius, all are void: export the scan again.")
    radius = np.where(valid, raw.astype(np.float64) * 2**shift / 1000, np.nan)
    radius, valid = radius.T[::-1], valid.T[::-1]  # the top row first
    step = abs(fields["LGINCR"]) * 1e-6
    if abs(nlg * step - TURN) < 0.01 * TURN:
        step = TURN / nlg  # microradians do not close the circle exactly
    if not fields["RIGHT"]:  # the subject's right first
        radius, valid, first = radius[:, ::-1], valid[:, ::-1], np.pi - (nlg - 1) * step
    else:
        first = -np.pi
    origin, axes, rise = fields.get("PLACE", (np.zeros(3), np.eye(3), fields["LTINCR"] / 1000))
    top = rise * (nlt - 1 - nlt // 2)
    radius, valid = np.ascontiguousarray(radius), np.ascontiguousarray(valid)
    made = RangeMap(radius, valid, None, first, step, top, rise, origin, axes)
    return made if image is None else with_colour(made, image if fields["RIGHT"] else image[:, ::-1])


def _text_header(data, name):
    end = data[:65536].find(END)
    if end < 0:
        raise InputError(f"{name} has no end of its header (DATA=): copy or export the scan again.")
    lines = data[:end].decode("latin-1").splitlines()
    given = dict(line.strip().split("=", 1) for line in lines if "=" in line)
    missing = [key for key in _NEEDED if key not in given]
    if missing:
        raise InputError(f"{name} does not say {', '.join(missing)} in its header: export the scan again.")
    fields = {}
    try:
        for key in _NEEDED:
            fields[key] = int(given[key])
        for key, fallback in (("LTMIN", 0), ("LTMAX", fields["NLT"] - 1), ("LGMIN", 0), ("LGMAX", fields["NLG"] - 1)):
            fields[key] = int(given.get(key, fallback))
        if "PLACE" in given:  # our own addition: where the axis stands in the scan's place
            numbers = np.array(given["PLACE"].split(), dtype=float)
            fields["PLACE"] = numbers[:3] / 1000, numbers[3:12].reshape(3, 3), float(numbers[12])
    except (ValueError, IndexError):
        raise InputError(f"{name} has something in its header that is no number: export the scan again.") from None
    fields["SPACE"] = given.get("SPACE", "CYLINDRICAL").strip().upper()
    fields["RIGHT"] = "THETA_RIGHTHAND" in given
    return fields, end + len(END)


def _binary_header(data, name):
    offset = int.from_bytes(data[4:8], "big") if len(data) >= 128 else 0
    if offset not in _OLD:
        raise InputError(f"{name} is no Cyberware range file although it is named so: export the scan again.")
    values = struct.unpack_from(_OLD[offset], data)
    _, nlt, nlg, shift, _, flags, ltincr, lgincr, ltmin, ltmax, lgmin, lgmax = values
    return {
        "NLT": nlt,
        "NLG": nlg,
        "LTINCR": ltincr,
        "LGINCR": lgincr,
        "RSHIFT": shift,
        "LTMIN": ltmin,
        "LTMAX": ltmax if ltmax > ltmin else nlt - 1,
        "LGMIN": lgmin,
        "LGMAX": lgmax if lgmax > lgmin else nlg - 1,
        "SPACE": "CARTESIAN" if flags & _CARTESIAN else "CYLINDRICAL",
        "RIGHT": bool(flags & _RIGHTHAND),
    }, offset


def echo_bytes(range_map: RangeMap, name: str = "head") -> bytes:
    """An Echo file of a map. Its line ``PLACE``, which others pass over, says where the axis stands in the scan's place."""
    h, w = range_map.shape
    micrometres = np.where(range_map.valid, range_map.radius * 1000, 0)
    largest = int(micrometres.max()) + 1
    shift = max(0, largest.bit_length() - 15)
    raw = np.where(range_map.valid, np.rint(micrometres / 2**shift), VOID).astype(">i2")
    raw = raw[::-1, ::-1].T  # longitudes toward the subject's right, each from the bottom up
    rise = round(range_map.rise * 1000)
    # The scanner counts from half a turn before the front and from the middle row: what is left over moves the axis.
    angle = range_map.longitudes[-1] - np.pi
    c, s = np.cos(angle), np.sin(angle)
    axes = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ range_map.axes
    middle = range_map.top - range_map.rise * (h - 1 - h // 2)
    origin = range_map.origin + middle * range_map.axes[2]
    place = " ".join([f"{x:.3f}" for x in origin * 1000] + [f"{x:.12g}" for x in [*axes.ravel(), range_map.rise]])
    lines = [
        "Cyberware Digitizer Data",
        "NAME=" + name.encode("ascii", "replace").decode()[:40],
        "SPACE=CYLINDRICAL",
        *(["COLOR=SGI"] if range_map.colour is not None else []),
        *(f"{key}={value}" for key, value in (("NLG", w), ("LGINCR", round(range_map.step * 1e6)))),
        *(f"{key}={value}" for key, value in (("LGMIN", 0), ("LGMAX", w - 1), ("NLT", h), ("LTINCR", rise))),
        *(f"{key}={value}" for key, value in (("LTMIN", 0), ("LTMAX", h - 1), ("RMIN", 0), ("RMAX", largest))),
        *(f"{key}={value}" for key, value in (("RSHIFT", shift), ("LGSHIFT", max(h - 1, 1).bit_length()))),
        "PLACE=" + place,
        "DATA=",
    ]
    return ("\n".join(lines) + "\n").encode("ascii") + raw.tobytes()


def colour_path(path: Path) -> Path | None:
    """The colour file beside a range file: its name, or the name without its extension, with .color, .rgb, .sgi or .png."""
    for base in (path.with_suffix(""), path):
        for extension in (".color", ".rgb", ".sgi", ".png"):
            found = base.with_name(base.name + extension)
            if found.is_file() and found != path:
                return found
    return None


def with_colour(range_map: RangeMap, image: np.ndarray) -> RangeMap:
    """The map with the colours of ``image`` (h', w', 3) 0..1, which shows what the map shows, at any resolution.

    Black texels without range have no colour: the camera saw nothing there.
    """
    (h, w), (rows, columns) = range_map.shape, image.shape[:2]
    i = np.minimum(((np.arange(h) + 0.5) * rows / h).astype(int), rows - 1)
    j = np.minimum(((np.arange(w) + 0.5) * columns / w).astype(int), columns - 1)
    colour = np.array(image[np.ix_(i, j)], dtype=np.float32)
    colour[(colour <= 0).all(axis=2) & ~range_map.valid] = np.nan
    return replace(range_map, colour=colour)
