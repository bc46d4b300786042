# SPDX-License-Identifier: GPL-3.0-or-later
"""A head's animation as an H.264 film, rendered picture by picture so that it can be followed and stopped."""

import tempfile
from contextlib import contextmanager
from pathlib import Path

import bpy

from ..sim.errors import InputError
from ..sim.progress import Progress, Work
from . import heads
from .outputs import Outputs
from .pictures import grounded, read_drawn, render_frame, write_picture
from .quiet import quiet
from .studio import studio
from .whole_files import require_whole

GROUND = (0.085, 0.089, 0.098)


def render_movie(
    skin: bpy.types.Object,
    path,
    frames: tuple[int, int] | None = None,
    size: tuple[int, int] = (480, 480),
    samples: int = 8,
    engine: str = "CYCLES",
    yaw: float = 12.0,
) -> Work:
    """Render the head's shape-key animation into an MP4 file; returns its path.

    Parameters
    ----------
    frames : first and last frame; by default those of the head's action
    size : width and height in pixels, even numbers

    Raises
    ------
    InputError : not a head, nothing is animated, or odd sizes, which H.264 cannot hold.
    """
    if any(length % 2 or length < 2 for length in size):
        raise InputError(f"A film of {size[0]} by {size[1]} pixels cannot be written as H.264: use even numbers.")
    first, last = frames or animated_frames(skin)
    fps, base = bpy.context.scene.render.fps, bpy.context.scene.render.fps_base
    with Outputs() as outputs, tempfile.TemporaryDirectory(prefix="headshop-") as folder:
        target = outputs.file(path)
        pictures = []
        stage = {"width": size[0], "height": size[1], "samples": samples, "engine": engine, "yaw": yaw, "close": True}
        with _values_kept(skin), studio(skin, **stage) as (scene, _):
            scene.render.fps, scene.render.fps_base = fps, base
            for part, obj in heads.parts_of(skin).items():
                if part not in ("skull", "mandible"):
                    scene.collection.objects.link(obj)
            for frame in range(first, last + 1):
                done = (frame - first) / (last - first + 1)
                yield Progress(0.97 * done, f"Rendering frame {frame} of {last}")
                pictures.append(render_frame(scene, frame, folder))
                write_picture(pictures[-1], grounded(read_drawn(pictures[-1]), GROUND))
        yield Progress(0.97, "Writing the film")
        encode(pictures, target, size, fps, base)
    return path


@contextmanager
def _values_kept(skin: bpy.types.Object):
    """Playing another scene's frames writes the values of those frames into the shape keys: put them back."""
    keys = [obj.data.shape_keys for obj in heads.parts_of(skin).values() if obj.data.shape_keys]
    kept = [(block, block.value) for key in keys for block in key.key_blocks]
    try:
        yield
    finally:
        for block, value in kept:
            block.value = value


def animated_frames(skin: bpy.types.Object) -> tuple[int, int]:
    """First and last frame of the skin's shape-key animation.

    Raises
    ------
    InputError : nothing is animated.
    """
    keys = skin.data.shape_keys
    animation = keys.animation_data if keys else None
    if animation is None or animation.action is None:
        raise InputError(f"Nothing of {heads.head_name(skin)!r} is animated: bake a performance first.")
    first, last = animation.action.frame_range
    return round(first), round(last)


def encode(pictures: list[Path], path: Path, size: tuple[int, int], fps: int, fps_base: float = 1.0) -> None:
    """Join PNG pictures into an H.264 film without sound, by Blender's own sequencer and FFmpeg.

    Raises
    ------
    InputError : it cannot be written, or not all of it; Blender does not tell.
    """
    scene = bpy.data.scenes.new("Head Shop Film")
    try:
        # The pictures are finished: show them as they are.
        scene.view_settings.view_transform = "Standard"
        scene.sequencer_colorspace_settings.name = "sRGB"
        strips = scene.sequence_editor_create().strips
        strip = strips.new_image("film", str(pictures[0]), channel=1, frame_start=1)
        for picture in pictures[1:]:
            strip.elements.append(picture.name)
        strip.frame_final_duration = len(pictures)
        strip.colorspace_settings.name = "sRGB"
        scene.frame_start, scene.frame_end = 1, len(pictures)
        render = scene.render
        render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
        render.fps, render.fps_base = fps, fps_base
        render.use_sequencer, render.use_compositing = True, False
        render.use_file_extension = False
        render.filepath = str(path)
        if hasattr(render.image_settings, "media_type"):  # since 5.0
            render.image_settings.media_type = "VIDEO"
        render.image_settings.file_format = "FFMPEG"
        render.image_settings.color_mode = "RGB"
        film = render.ffmpeg
        film.format, film.codec, film.audio_codec = "MPEG4", "H264", "NONE"
        film.constant_rate_factor, film.ffmpeg_preset, film.gopsize = "HIGH", "GOOD", 12
        with quiet():
            bpy.ops.render.render(animation=True, scene=scene.name)
    finally:
        bpy.data.scenes.remove(scene)
    require_whole(path)
