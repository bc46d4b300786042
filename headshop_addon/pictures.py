# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures as arrays: render one, read one, write one."""

import tempfile
from contextlib import suppress
from pathlib import Path

import bpy
import numpy as np

from ..sim.errors import InputError
from .quiet import quiet
from .whole_files import require_whole


def read_picture(path) -> np.ndarray:
    """(height, width, 4) float32 0..1, display values, top row first."""
    image = bpy.data.images.load(str(path), check_existing=False)
    try:
        image.colorspace_settings.name = "Non-Color"
        width, height = image.size
        pixels = np.empty(width * height * 4, dtype=np.float32)
        image.pixels.foreach_get(pixels)
    finally:
        bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)[::-1].copy()


def read_drawn(path: Path) -> np.ndarray:
    """`read_picture` of what Blender has just drawn into a folder of its own for temporary files.

    Raises
    ------
    InputError : not all of it was written; Blender does not tell.
    """
    try:
        require_whole(path)
    except InputError:
        where = path.parent.parent
        raise InputError(
            f"Pictures cannot be drawn in {where}, the folder for temporary files: is the disk full?"
        ) from None
    return read_picture(path)


def write_picture(path, pixels: np.ndarray) -> None:
    """Write (height, width, 4) display values 0..1, top row first, as an 8-bit PNG.

    Raises
    ------
    InputError : it cannot be written, or not all of it; Blender does not tell.
    """
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("Head Shop", width, height, alpha=True)
    try:
        image.pixels.foreach_set(np.ascontiguousarray(pixels[::-1], dtype=np.float32).ravel())
        image.file_format = "PNG"
        image.filepath_raw = str(path)
        with quiet(), suppress(RuntimeError):  # what came of it is looked at
            image.save()
    finally:
        bpy.data.images.remove(image)
    require_whole(Path(path))


def _as_png(scene) -> None:
    """Set the scene to write PNG, 8 bits."""
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):  # since 5.0
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode, settings.color_depth, settings.compression = "PNG", "RGB", "8", 15


def render_frame(scene, frame: int, folder) -> Path:
    """Render one frame of the scene's animation into a PNG file in ``folder``; returns its path."""
    _as_png(scene)
    # A still of a scene that is not in a window does not move to its frame: ask for an animation of one frame.
    scene.frame_start = scene.frame_end = frame
    scene.render.filepath = str(Path(folder) / "######")
    with quiet():
        bpy.ops.render.render(animation=True, scene=scene.name)
    return Path(scene.render.frame_path(frame=frame))


def render_picture(scene) -> np.ndarray:
    """Render a still of the scene: (height, width, 4) float32 0..1, display values, top row first."""
    _as_png(scene)
    with tempfile.TemporaryDirectory(prefix="headshop-") as folder:
        scene.render.filepath = str(Path(folder) / "still.png")
        with quiet():
            bpy.ops.render.render(write_still=True, scene=scene.name)
        return read_drawn(Path(scene.render.filepath))


def grounded(picture: np.ndarray, colour) -> np.ndarray:
    """The picture (h, w, 3 or more) passing into a colour over its lowest fifth, where a neck ends."""
    height = len(picture)
    fall = np.clip((np.arange(height) / height - 0.80) / 0.20, 0, 1)
    fall = (fall * fall * (3 - 2 * fall)).astype(np.float32)[:, None, None]
    out = picture.copy()
    out[..., :3] += fall * (np.asarray(colour, dtype=np.float32) - picture[..., :3])
    return out
