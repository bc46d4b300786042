# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a head stands in the scene while it acts: read from its object's animation, or written to it.

What a performance says of the head goes to the skin object's delta transforms, so that an artist's own placing and keys
of the head stay as they are.
"""

import bpy
import numpy as np

from ..sim.acting.head_motion import HeadMotion, felt
from ..sim.acting.turbulence import gusty
from . import bridge, live, own_data
from .slotted_actions import animate, new_action, stop

PLACED = "headshop_placed"


def read_motion(skin: bpy.types.Object, scene: bpy.types.Scene, frames) -> HeadMotion:
    """The motion of the head's object over ``frames`` of ``scene``, whatever moves it: keys, parents, constraints."""
    rotations, positions = [], []
    for shown in at_frames(skin, scene, frames):
        place = shown.matrix_world
        rotations.append(np.array(place.to_quaternion().to_matrix()))
        positions.append(np.array(place.translation) / bridge.METRES)
    return HeadMotion(np.array(rotations), np.array(positions), frame_rate(scene))


def at_frames(skin: bpy.types.Object, scene: bpy.types.Scene, frames):
    """The evaluated object of a head at each of ``frames``, without the face following; the scene's frame is as before then."""
    now = scene.frame_current_final
    with live.paused():
        try:
            for frame in frames:
                scene.frame_set(int(frame))
                yield skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
        finally:
            scene.frame_set(int(now), subframe=now % 1)


def frame_rate(scene: bpy.types.Scene) -> float:
    """Frames a second."""
    return scene.render.fps / scene.render.fps_base


def set_frame_rate(scene: bpy.types.Scene, fps: float) -> None:
    """Let the scene play ``fps`` frames a second, which Blender holds as a whole number over a base."""
    whole = max(round(fps), 1)
    scene.render.fps, scene.render.fps_base = whole, whole / fps


def felt_in(skin: bpy.types.Object, scene: bpy.types.Scene, frames):
    """Function of the skin's points (n, 3) mm at rest: what acts on them from outside at each of ``frames``.

    Gravity is the scene's, none where it is switched off; the head moves as its object does; the wind is the head's own
    setting.
    """
    gravity = np.array(scene.gravity) / bridge.METRES if scene.use_gravity else np.zeros(3)
    motion = read_motion(skin, scene, frames)
    settings = skin.headshop
    wind = np.tile(np.array(settings.wind) / bridge.METRES, (len(motion), 1))

    def around(points):
        air = wind if wind.any() else None
        if wind.any() and settings.turbulence:
            where = points @ motion.rotations[0].T + motion.positions[0]
            share = np.full(len(motion), settings.turbulence)
            air = gusty(wind, share, where, np.asarray(frames) / motion.fps, settings.wind_seed)
        return felt(motion, gravity, air)

    return around


def write_motion(skin: bpy.types.Object, motion: HeadMotion, frames: np.ndarray, name: str) -> None:
    """Animate the head's object by ``motion``, one pose of it at each of ``frames``; nothing if the head stays."""
    from mathutils import Matrix

    if motion.still:
        return
    angles, last = [], None
    for turn in motion.rotations:  # Euler angles that follow each other without jumps
        last = Matrix(turn).to_euler("XYZ", last) if last is not None else Matrix(turn).to_euler("XYZ")
        angles.append(tuple(last))
    places = motion.positions * bridge.METRES
    curves = {("delta_location", axis): places[:, axis] for axis in range(3)}
    curves |= {("delta_rotation_euler", axis): np.array(angles)[:, axis] for axis in range(3)}
    animate(new_action(name), skin, "OBJECT", frames, curves)
    own_data.keep_note(skin, PLACED, True)


def remove_motion(skin: bpy.types.Object) -> None:
    """Take a motion that `write_motion` wrote off a head again."""
    if not own_data.note(skin, PLACED):
        return
    stop(skin)
    skin.delta_location = skin.delta_rotation_euler = (0.0, 0.0, 0.0)
    own_data.drop_note(skin, PLACED)
