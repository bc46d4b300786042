# SPDX-License-Identifier: GPL-3.0-or-later
"""The face follows the sliders: the simulated pose is the shape key ``Live`` of the skin and of what moves along.

Simulated models are cached here, one per skin, and made anew when the head they were made from is no longer the one in
the scene (undo, reload, sculpting). The sliders are the truth; the cache and the shape key only follow.
"""

from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ..sim.acting.models import model_named
from ..sim.errors import InputError
from . import bridge, dependencies, heads, jobs, muscle_names, response

KEY = "Live"
#: Solver iterations for one look while a slider is dragged or the time line plays, and for each round of the timer that
#: brings the face to rest afterwards. Without a window the face is brought to rest at once.
LOOK, ROUND, REST = 8, 25, 60
#: The timer stops when a round moves no vertex by more than this (mm), or after so many rounds.
VISIBLE, ROUNDS = 0.05, 12
#: `HEADSHOP_PG_object.model` -> the name of a model that keeps up with a slider; instant, where it was not
#: prepared.
MODELS = {"SIMULATED": "headshop", "INSTANT": "headshop", "DIRECT": "waters"}
STILL = 0.001  # mm: a part that never moved more needs no key

_depth = 0  # > 0 while nothing must follow


class _Instant:
    """Acts by what was learnt of the simulation (`response`): as `sim.acting.models.ActingModel` does."""

    def rest_state(self, model):
        """The head itself."""
        return model.rest_state()

    def look(self, model, control, state, rounds):
        """The pose, at rest at once."""
        return model.state(control), True

    def follower(self, model):
        """Nothing has to be kept."""
        return None


INSTANT = _Instant()


@dataclass
class _Following:
    """What acts for one skin: its model, where it rests, the last state, what goes on from frame to frame (or None), and the
    sliders it belongs to."""

    acting: Any
    fingerprint: int
    model: Any
    neutral: dict[str, np.ndarray]
    state: Any
    frames: Any
    pose: tuple | None = None
    settled: bool = True
    rounds: int = 0


_following: dict[int, _Following] = {}


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
        rest(skin)


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


def rest(skin) -> None:
    """Take the live pose off the head: its ``Live`` shape keys are removed."""
    for obj in heads.parts_of(skin).values():
        keys = obj.data.shape_keys
        block = keys.key_blocks.get(KEY) if keys else None
        if block is not None:
            obj.shape_key_remove(block)
            if len(keys.key_blocks) == 1:  # the basis we made alone
                obj.shape_key_clear()
    _following.pop(skin.session_uid, None)


def forget(skin) -> None:
    """What acts for a head has changed: look for it again at the next slider."""
    _following.pop(skin.session_uid, None)


def follow(skin, depsgraph=None) -> None:
    """Bring the head to where its sliders say; does nothing while paused, switched off, or not a head."""
    if _depth or not heads.is_skin(skin) or not skin.headshop.live or skin.library or skin.mode != "OBJECT":
        return
    if not dependencies.available("scipy"):
        return
    unhurried = bpy.app.background or bpy.app.is_job_running("RENDER")
    following = _try(skin, sliders(skin, depsgraph), REST if unhurried else LOOK)
    if following is not None and not following.settled:
        following.rounds = 0
        if not bpy.app.timers.is_registered(_settle):
            bpy.app.timers.register(_settle, first_interval=0.2)


def _settle():
    """Timer: another round for every face that is not at rest; nothing while a job runs or the time line plays."""
    windows = bpy.context.window_manager.windows
    if jobs.running is not None or any(window.screen.is_animation_playing for window in windows):
        return 0.3
    waiting = False
    for skin in heads.find_heads(bpy.context.scene):
        following = _following.get(skin.session_uid)
        if following is None or following.settled or not skin.headshop.live or skin.mode != "OBJECT":
            continue
        before, rounds = following.state.skin, following.rounds + 1
        following.pose = None  # asks for more of the same
        following = _try(skin, sliders(skin), ROUND)
        if following is not None:
            still = np.abs(following.state.skin - before).max(initial=0.0) < VISIBLE
            following.rounds, following.settled = rounds, following.settled or still or rounds >= ROUNDS
            waiting = waiting or not following.settled
    return 0.02 if waiting else None


def _try(skin, values, iterations) -> _Following | None:
    """`_solve`, or None with a line in the console where the head cannot be simulated."""
    with paused():
        try:
            return _solve(skin, values, iterations)
        except InputError as error:
            print(f"Head Shop: {error}")
            _following.pop(skin.session_uid, None)
            return None


def _solve(skin, values, iterations) -> _Following | None:
    from ..sim.acting.pose import control, pose_from
    from ..sim.tissue.posing import posed_parts

    moving = any(values.values())
    following = _current(skin, moving)
    pose = tuple(values.values())
    if following is None or following.pose == pose:
        return following
    following.pose, following.settled = pose, True
    if moving:
        known = {*following.model.muscle_names, *muscle_names.CONTROLS}
        wanted = control(following.model, pose_from({name: v for name, v in values.items() if name in known}))
        if following.frames is None:
            following.state, settled = following.acting.look(following.model, wanted, following.state, iterations)
        else:
            following.state, settled = following.frames.look(wanted, iterations)
        following.settled = settled or iterations == REST
        posed = posed_parts(following.model, following.state, wanted)
    else:  # rest is the scan itself, exactly
        following.state, posed = following.acting.rest_state(following.model), following.neutral
        following.frames = following.acting.follower(following.model)  # what comes next begins here, undone or not
    objects = heads.parts_of(skin)
    for part, vertices in posed.items():
        _write(skin, objects[part], vertices - following.neutral[part])
    return following


def _current(skin, moving: bool) -> _Following | None:
    """The simulation of this head, made where there is none; a head at rest that never moved needs none."""
    keys = skin.data.shape_keys
    if not moving and (keys is None or KEY not in keys.key_blocks):
        return None
    mark = response.fingerprint(skin)
    following = _following.get(skin.session_uid)
    instant = skin.headshop.model == "INSTANT" and response.is_current(skin, mark)
    acting = INSTANT if instant else model_named(MODELS[skin.headshop.model])
    if following is not None and (following.fingerprint, following.acting) == (mark, acting):
        return following
    from ..sim.acting.pose import Pose, control
    from ..sim.tissue.posing import posed_parts

    model = response.acted(skin, mark) if instant else acting.build(heads.read_head(skin))
    state = acting.rest_state(model)
    following = _Following(
        acting, mark, model, posed_parts(model, state, control(model, Pose())), state, acting.follower(model)
    )
    _following[skin.session_uid] = following
    return following


def _write(skin, obj, delta):
    """Set the part's ``Live`` key to its rest shape plus ``delta`` (n, 3) mm, given in the skin's space."""
    if obj != skin and KEY not in (obj.data.shape_keys.key_blocks if obj.data.shape_keys else ()):
        if np.abs(delta).max(initial=0.0) < STILL:
            return
    block = bridge.ensure_shape_key(obj, KEY)
    turn = np.linalg.inv(heads.placement(skin, obj)[:3, :3])
    bridge.write_positions(obj, bridge.read_positions(obj) + delta @ turn.T, KEY)
    if block.value != 1.0:
        block.value = 1.0


@persistent
def _on_frame(scene, depsgraph=None):
    for skin in heads.find_heads(scene):
        follow(skin, depsgraph)


@persistent
def _on_history(*_):
    """After undo, redo or loading a file the cache may speak of other heads; the fingerprint decides."""
    for number, following in list(_following.items()):
        following.pose = None
        following.frames = following.acting.follower(following.model)
        if following.acting is INSTANT:  # what was learnt may be another now
            del _following[number]
    for skin in heads.find_heads(bpy.context.scene):
        follow(skin)


@persistent
def _on_load(*_):
    _following.clear()


_HANDLERS = (
    ("frame_change_post", _on_frame),
    ("undo_post", _on_history),
    ("redo_post", _on_history),
    ("load_post", _on_load),
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
    _following.clear()
