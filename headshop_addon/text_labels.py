# SPDX-License-Identifier: GPL-3.0-or-later
"""Text and panels for composed pictures, set in the typeface that comes with Blender."""

import tempfile
from functools import lru_cache
from pathlib import Path

import blf
import bpy
import imbuf
import numpy as np

from .pictures import read_drawn

_FINER = 3  # text is drawn larger and averaged down: Blender's own smoothing snaps strokes to whole pixels


def _font() -> int:
    """The number of the interface typeface (Inter), or of Blender's fallback."""
    folder = bpy.utils.system_resource("DATAFILES", path="fonts")
    path = Path(folder or "") / "Inter.woff2"
    found = blf.load(str(path)) if path.is_file() else -1
    return found if found >= 0 else 0


def text_width(text: str, size: float) -> float:
    """Width in pixels of ``text`` set in ``size`` pixels."""
    font = _font()
    blf.size(font, size * _FINER)
    return blf.dimensions(font, text)[0] / _FINER


@lru_cache(maxsize=512)
def text_mask(text: str, size: float) -> np.ndarray:
    """(h, w) float32 coverage 0..1 of ``text``; the base line is `baseline` rows from the top."""
    font = _font()
    blf.size(font, size * _FINER)
    width = int(np.ceil(blf.dimensions(font, text)[0] / _FINER)) + 6
    height = int(np.ceil(1.5 * size))
    buffer = imbuf.new((width * _FINER, height * _FINER))
    blf.color(font, 1.0, 1.0, 1.0, 1.0)
    blf.position(font, 2 * _FINER, (height - baseline(size)) * _FINER, 0)
    with blf.bind_imbuf(font, buffer):
        blf.draw_buffer(font, text)
    with tempfile.TemporaryDirectory(prefix="headshop-") as folder:
        path = Path(folder) / "text.png"
        imbuf.write(buffer, filepath=str(path))
        buffer.free()
        drawn = read_drawn(path)[..., 3]
    return drawn.reshape(height, _FINER, width, _FINER).mean(axis=(1, 3))


def baseline(size: float) -> int:
    """Rows from the top of a text mask to its base line."""
    return int(np.ceil(1.1 * size))


def put_text(canvas: np.ndarray, text: str, x: float, y: float, size: float, colour, align: str = "left") -> float:
    """Set ``text`` on a canvas (h, w, 3 or 4) with its base line at row ``y``; returns its width in pixels.

    align : ``left``, ``centre`` or ``right`` of column ``x``; colour : (r, g, b, opacity)
    """
    if not text:
        return 0.0
    mask = text_mask(text, float(size))
    width = text_width(text, size)
    left = int(round(x - {"left": 0.0, "centre": width / 2, "right": width}[align])) - 2
    top = int(round(y)) - baseline(size)
    blend(canvas, mask * colour[3], colour[:3], left, top)
    return width


def blend(canvas: np.ndarray, mask: np.ndarray, colour, left: int, top: int) -> None:
    """Lay a colour, or a picture (h, w, 3), over the canvas through a mask (h, w); what falls outside is cut off."""
    height, width = mask.shape
    y0, y1, x0, x1 = max(top, 0), min(top + height, len(canvas)), max(left, 0), min(left + width, canvas.shape[1])
    if y0 >= y1 or x0 >= x1:
        return
    part = (slice(y0 - top, y1 - top), slice(x0 - left, x1 - left))
    cover = mask[part][..., None]
    colour = np.asarray(colour, dtype=np.float32)
    colour = colour[part] if colour.ndim == 3 else colour
    area = canvas[y0:y1, x0:x1, :3]
    area += cover * (colour - area)


def rounded(height: int, width: int, radius: float) -> np.ndarray:
    """(height, width) float32 mask of a panel with rounded corners."""
    y = np.abs(np.arange(height)[:, None] + 0.5 - height / 2) - (height / 2 - radius)
    x = np.abs(np.arange(width)[None] + 0.5 - width / 2) - (width / 2 - radius)
    away = np.hypot(np.maximum(x, 0), np.maximum(y, 0))
    return np.clip(radius - away + 0.5, 0, 1).astype(np.float32)
