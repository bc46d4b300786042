# SPDX-License-Identifier: GPL-3.0-or-later
"""PNG images of 8 and 16 bits (ISO/IEC 15948) to arrays and back, so that maps are read without Blender."""

import struct
import zlib

import numpy as np

from ..errors import InputError

SIGNATURE = b"\x89PNG\r\n\x1a\n"
_CHANNELS = {0: 1, 2: 3, 4: 2, 6: 4}
#: Pixels of the largest image that is read.
LARGEST = 64_000_000


def read_png(data: bytes, name: str) -> np.ndarray:
    """(h, w, k) uint8 or uint16 of a grey (k = 1 or 2 with alpha) or colour (3 or 4) PNG, the first row at the top.

    Raises
    ------
    InputError : no PNG, damaged, too large, or one with a palette or interlaced.
    """
    if data[:8] != SIGNATURE:
        named = " although it is named so: export it again" if name.lower().endswith(".png") else ": save it as one"
        raise InputError(f"{name} is not a PNG image{named}.")
    try:
        w, h, depth, kind, _, _, interlaced = struct.unpack(">IIBBBBB", data[16:29])
    except struct.error:
        raise _damaged(name) from None
    if kind not in _CHANNELS or depth not in (8, 16) or interlaced:
        raise InputError(
            f"{name} is a PNG with a palette, interlaced or of {depth} bits: save it as grey or RGB of 8 or 16 bits."
        )
    if not 0 < w * h <= LARGEST:
        raise InputError(f"{name} measures {w} x {h} pixels, more than is read: reduce it.")
    try:
        packed, at = [], 8
        while at + 8 <= len(data):
            size, chunk = struct.unpack(">I4s", data[at : at + 8])
            if chunk == b"IDAT":
                packed.append(data[at + 8 : at + 8 + size])
            at += size + 12
        channels = _CHANNELS[kind]
        pixel = channels * depth // 8
        raw = np.frombuffer(zlib.decompress(b"".join(packed)), np.uint8)[: h * (w * pixel + 1)]
        rows = _unfiltered(raw.reshape(h, w * pixel + 1), pixel)
    except (struct.error, zlib.error, ValueError):
        raise _damaged(name) from None
    return rows.view(">u2" if depth == 16 else np.uint8).reshape(h, w, channels).astype(f"u{depth // 8}")


def _damaged(name) -> InputError:
    return InputError(f"{name} is cut off or damaged: copy or export it again.")


def _unfiltered(rows: np.ndarray, pixel: int) -> np.ndarray:
    """Undo the filter of each row (first byte): none, sub, up, average, Paeth."""
    h, w = rows.shape[0], rows.shape[1] - 1
    out = np.zeros((h, w), dtype=np.uint8)
    above = np.zeros(w, dtype=np.uint8)
    for k in range(h):
        kind, line = rows[k, 0], rows[k, 1:]
        if kind == 0:
            row = line
        elif kind == 1:
            row = np.cumsum(line.reshape(-1, pixel), axis=0, dtype=np.uint8).ravel()
        elif kind == 2:
            row = line + above
        elif kind in (3, 4):
            row = _sequential(kind, line.tolist(), above.tolist(), pixel)
        else:
            raise ValueError("no such filter")
        out[k] = row
        above = out[k]
    return out


def _sequential(kind, line, above, pixel):
    """Average and Paeth look at the byte to the left, so they go byte by byte."""
    row = [0] * pixel
    upper = [0] * pixel + above
    for k, value in enumerate(line):
        a, b, c = row[k], upper[k + pixel], upper[k]
        if kind == 3:
            guess = (a + b) >> 1
        else:
            p, q, r = abs(b - c), abs(a - c), abs(a + b - 2 * c)
            guess = a if p <= q and p <= r else b if q <= r else c
        row.append((value + guess) & 255)
    return np.array(row[pixel:], dtype=np.uint8)


def png_bytes(image: np.ndarray) -> bytes:
    """A PNG file of ``image`` (h, w) or (h, w, 3), uint8 or uint16, the first row at the top."""
    image = image[..., None] if image.ndim == 2 else image
    h, w, channels = image.shape
    depth = 8 * image.dtype.itemsize
    body = np.ascontiguousarray(image.astype(f">u{depth // 8}")).view(np.uint8).reshape(h, -1)
    body = np.concatenate([np.zeros((h, 1), np.uint8), body], axis=1).tobytes()

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", w, h, depth, 0 if channels == 1 else 2, 0, 0, 0)
    return SIGNATURE + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(body, 6)) + chunk(b"IEND", b"")
