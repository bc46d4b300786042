# SPDX-License-Identifier: GPL-3.0-or-later
"""Detail maps as 16-bit PNG files, top row first.

Displacement: grey, the middle (32768) is 0, white is +`DEEPEST` mm along the normal, black the same inward. Normal: red
along u, green along v, blue outward, each -1..1 as 0..65535 (OpenGL's convention).
"""

import struct
import zlib

import numpy as np

from .detail_map import DEEPEST, DetailMaps


def displacement_png(maps: DetailMaps) -> bytes:
    """The displacement map as a PNG file."""
    return png16(_stepped(maps.displacement[::-1] / (2 * DEEPEST)) + 0.5)


def normal_png(maps: DetailMaps) -> bytes:
    """The normal map as a PNG file."""
    return png16(_stepped(maps.normal[::-1] / 2) + 0.5)


def _stepped(values):
    """In steps of 1/8192, half a micrometre or a hundredth of a degree: what is finer is noise and does not compress."""
    return np.round(values * 8192) / 8192


def png16(values: np.ndarray) -> bytes:
    """A PNG file of values (h, w) or (h, w, 3) in 0..1 with 16 bits per channel, top row first."""
    height, width = values.shape[:2]
    whole = np.clip(np.floor(values * 65535 + 0.5), 0, 65535).astype(">u2")
    rows = whole.reshape(height, -1).view(np.uint8)
    channels = 1 if values.ndim == 2 else values.shape[2]
    rows = rows.copy()
    rows[1:] -= rows[:-1].copy()  # filter 2, "up": each byte less the one above
    lines = np.concatenate([np.full((height, 1), 2, dtype=np.uint8), rows], axis=1)
    header = struct.pack(">IIBBBBB", width, height, 16, {1: 0, 3: 2}[channels], 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(lines.tobytes(), 6)), (b"IEND", b""))
    out = b"\x89PNG\r\n\x1a\n"
    for kind, data in chunks:
        out += struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    return out
