# SPDX-License-Identifier: GPL-3.0-or-later
"""The face follows the sliders, dragged, keyed or undone: they are the truth, what poses the head (`following`) comes after."""

from contextlib import contextmanager

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ..sim.errors import InputError
from . import dependencies, following, heads, jobs

#: Solver iterations for one look while a slider is dragged or the time line plays, and for each round of the timer that
#: brings the face to rest afterwards.
LOOK, ROUND = 8, 25
#: The timer stops when a round moves no vertex by more than this (mm), or after so many rounds.
VISIBLE, ROUNDS = 0.05, 12

_depth = 0  # > 0 while nothing must follow


@contextmanager
def paused():
    """While sliders are set in bulk or a bake runs; the face follows once when the outermost pause ends."""
    global _depth
    _depth += 1
    try:
        yield
    finally:
        _depth -= 1


def on_slider(group, _context):
    """A slider was moved."""
    follow(group.id_data)


def on_switch(group, _context):
    """Live was switched on or off."""
    skin = group.id_data
    if not heads.is_skin(skin):
        return
    if group.live:
        follow(skin)
    else:
        following.rest(skin)


def on_model(group, _context):
    """Another model is to act."""
    follow(group.id_data)


def sliders(skin, depsgraph=None) -> dict[str, float]:
    """All muscles and controls of a head as they are now, animation included."""
    group = (skin.evaluated_get(depsgraph) if depsgraph else skin).headshop
    return {**group.muscles.values(), **group.controls.values()}


def set_sliders(skin, values: dict[str, float]) -> None:
    """Set the sliders named and all others to 0, with a single update of the face."""
    with paused():
        for group in (skin.headshop.muscles, skin.headshop.controls):
            for name in group.values():
                setattr(group, name, values.get(name, 0.0))
    follow(skin)


def key_sliders(skin, frame: int) -> None:
    """Insert a keyframe for every slider."""
    for kind in ("muscles", "controls"):
        for name in getattr(skin.headshop, kind).values():
            skin.keyframe_insert(f"headshop.{kind}.{name}", frame=frame, group="Head Shop")


def follow(skin, depsgraph=None) -> None:
    """Bring the head to where its sliders say; does nothing while paused, switched off, or not a head."""
    if _depth or not heads.is_skin(skin):
        return
    _let_override(skin)
    if not skin.headshop.live or skin.library or skin.mode != "OBJECT":
        return
    if not dependencies.available("scipy"):
        return
    unhurried = bpy.app.background or bpy.app.is_job_running("RENDER")
    now = _try(skin, sliders(skin, depsgraph), following.REST if unhurried else LOOK)
    if now is not None and not now.settled:
        now.rounds = 0
        if not bpy.app.timers.is_registered(_settle):
            bpy.app.timers.register(_settle, first_interval=0.2)


def _let_override(skin) -> None:
    """Where a library override acts, let the head that it overrides have sliders too.

    Blender keeps what a shot says of a slider as a difference from the library's. A head whose sliders nobody touched in the
    library has none stored; the difference would be the whole group, which Blender writes but cannot read again: every slider
    would be 0 when the shot is opened. Reading a group makes it.
    """
    linked = skin.override_library.reference if skin.override_library else None
    for each in (skin, linked) if heads.is_skin(linked) else ():
        _ = each.headshop.muscles, each.headshop.controls


def _settle():
    """Timer: another round for every face that is not at rest; nothing while a job runs or the time line plays."""
    windows = bpy.context.window_manager.windows
    if jobs.running is not None or any(window.screen.is_animation_playing for window in windows):
        return 0.3
    waiting = False
    for skin in heads.find_heads(bpy.context.scene):
        now = following.kept.get(skin.session_uid)
        if now is None or now.settled or not skin.headshop.live or skin.mode != "OBJECT":
            continue
        before, rounds = now.state.skin, now.rounds + 1
        now.pose = None  # asks for more of the same
        now = _try(skin, sliders(skin), ROUND)
        if now is not None:
            still = np.abs(now.state.skin - before).max(initial=0.0) < VISIBLE
            now.rounds, now.settled = rounds, now.settled or still or rounds >= ROUNDS
            waiting = waiting or not now.settled
    return 0.02 if waiting else None


def _try(skin, values, iterations) -> following.Following | None:
    """`following.pose`, or None with a line in the console where the head cannot be simulated."""
    with paused():
        try:
            return following.pose(skin, values, iterations)
        except InputError as error:
            print(f"Head Shop: {error}")
            following.forget(skin)
            return None


@persistent
def _on_frame(scene, depsgraph=None):
    for skin in heads.find_heads(scene):
        follow(skin, depsgraph)


@persistent
def _on_update(scene, depsgraph):
    """Sliders that drivers move follow what drives them at once; Blender calls no update of theirs."""
    if _depth or jobs.running is not None:
        return
    for skin in heads.find_heads(scene):
        if _is_driven(skin):
            now = following.kept.get(skin.session_uid)
            if now is None or now.pose != tuple(sliders(skin, depsgraph).values()):
                follow(skin, depsgraph)


def _is_driven(skin) -> bool:
    data = skin.animation_data
    return data is not None and any(curve.data_path.startswith("headshop.") for curve in data.drivers)


@persistent
def _on_history(*_):
    following.begin_anew()
    for skin in heads.find_heads(bpy.context.scene):
        follow(skin)


@persistent
def _on_load(*_):
    following.kept.clear()


@persistent
def _on_save(*_):
    for skin in filter(heads.is_skin, bpy.data.objects):
        _let_override(skin)


_HANDLERS = (
    ("frame_change_post", _on_frame),
    ("depsgraph_update_post", _on_update),
    ("undo_post", _on_history),
    ("redo_post", _on_history),
    ("load_post", _on_load),
    ("save_pre", _on_save),
)


def register():
    """Follow the time line and undo."""
    for name, handler in _HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)


def unregister():
    """Stop following; heads keep the pose they are in."""
    for name, handler in _HANDLERS:
        getattr(bpy.app.handlers, name).remove(handler)
    if bpy.app.timers.is_registered(_settle):
        bpy.app.timers.unregister(_settle)
    following.kept.clear()
