# SPDX-License-Identifier: GPL-3.0-or-later
"""SGI images (Haeberli, the SGI image file format): the colour files of Cyberware scanners.

A header of 512 bytes, big-endian, then each channel by itself, its rows from the bottom up, plain or run-length coded.
"""

import struct

import numpy as np

from ..errors import InputError

MAGIC = 474
_HEAD = struct.Struct(">HBBHHHH")


def read_sgi(data: bytes, name: str) -> np.ndarray:
    """(h, w, 3) float32 0..1, the first row at the top, of an SGI image in ``data``; grey ones become equal channels.

    Raises
    ------
    InputError : no SGI image, or cut off.
    """
    if len(data) < 512 or data[:2] != struct.pack(">H", MAGIC):
        raise InputError(f"{name} is not an SGI image, as a Cyberware colour file is: convert it to SGI or PNG.")
    _, coded, depth, dimension, w, h, channels = _HEAD.unpack_from(data)
    h = h if dimension > 1 else 1
    channels = channels if dimension > 2 else 1
    if not (w and h and channels) or depth not in (1, 2) or coded > 1:
        raise InputError(f"{name} is damaged, its header makes no sense: copy or export it again.")
    kind = np.dtype(">u2" if depth == 2 else "u1")
    used = min(channels, 3)
    try:
        planes = _coded(data, w, h, channels, used, kind) if coded else _plain(data, w, h, used, kind)
    except (ValueError, IndexError, struct.error):
        raise InputError(f"{name} is cut off or damaged: copy or export it again.") from None
    image = planes.astype(np.float32) / np.iinfo(kind).max
    image = np.moveaxis(image if used == 3 else image[:1].repeat(3, axis=0), 0, 2)
    return np.ascontiguousarray(image[::-1])


def _plain(data, w, h, used, kind):
    return np.frombuffer(data, kind, w * h * used, 512).reshape(used, h, w)


def _coded(data, w, h, channels, used, kind):
    """Rows as runs: a count in the low seven bits, its eighth says whether that many values follow or one to repeat."""
    table = np.frombuffer(data, ">u4", 2 * h * channels, 512).reshape(2, channels, h)
    out = np.zeros((used, h, w), dtype=kind)
    for channel in range(used):
        for row in range(h):
            start, size = int(table[0, channel, row]), int(table[1, channel, row])
            runs = np.frombuffer(data, kind, size // kind.itemsize, start)
            at = x = 0
            while at < len(runs):
                count, literal = int(runs[at]) & 127, int(runs[at]) & 128
                if not count:
                    break
                if x + count > w:
                    raise ValueError("a row is too long")
                out[channel, row, x : x + count] = runs[at + 1 : at + 1 + count] if literal else runs[at + 1]
                at, x = at + 1 + (count if literal else 1), x + count
    return out


def sgi_bytes(image: np.ndarray) -> bytes:
    """An SGI file of ``image`` (h, w, 3) 0..1 with the first row at the top, 8 bits a channel, not coded."""
    h, w, _ = image.shape
    head = _HEAD.pack(MAGIC, 0, 1, 3, w, h, 3) + struct.pack(">II", 0, 255)
    values = np.clip(np.rint(np.nan_to_num(image) * 255.0), 0, 255).astype(np.uint8)
    return head.ljust(512, b"\0") + np.ascontiguousarray(np.moveaxis(values[::-1], 2, 0)).tobytes()
