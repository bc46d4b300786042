# SPDX-License-Identifier: GPL-3.0-or-later
"""The pose of each skin as the sliders say: simulated models are kept here, one per skin, and made anew when the head that
they were made from is no longer the one in the scene (undo, reload, sculpting). A pose is the shape key ``Live``.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..sim.acting.models import model_named
from . import bridge, heads, muscle_names, own_data, response

KEY = "Live"
#: `HEADSHOP_PG_object.model` -> the name of a model that keeps up with a slider; instant, where it was not
#: prepared.
MODELS = {"SIMULATED": "headshop", "INSTANT": "headshop", "DIRECT": "waters"}
#: Solver iterations that count as rest: without a window the face is brought there at once.
REST = 60
STILL = 0.001  # mm: a part that never moved more needs no key


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
class Following:
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


#: `session_uid` of a skin -> what acts for it.
kept: dict[int, Following] = {}


def rest(skin) -> None:
    """Take the live pose off the head: its ``Live`` shape keys are removed."""
    own_data.own_meshes(skin)
    for obj in heads.parts_of(skin).values():
        keys = obj.data.shape_keys
        block = keys.key_blocks.get(KEY) if keys else None
        if block is not None:
            obj.shape_key_remove(block)
            if len(keys.key_blocks) == 1:  # the basis we made alone
                obj.shape_key_clear()
    kept.pop(skin.session_uid, None)


def forget(skin) -> None:
    """What acts for a head has changed: look for it again at the next slider."""
    kept.pop(skin.session_uid, None)


def pose(skin, values, iterations) -> Following | None:
    """Bring the head to slider ``values`` with at most so many solver ``iterations``; None where nothing ever moved it.

    Raises
    ------
    InputError : the head cannot be simulated.
    """
    from ..sim.acting.pose import control, pose_from
    from ..sim.tissue.posing import posed_parts

    moving = any(values.values())
    following = _current(skin, moving)
    asked = tuple(values.values())
    if following is None or following.pose == asked:
        return following
    following.pose, following.settled = asked, True
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
    own_data.own_meshes(skin)
    objects = heads.parts_of(skin)
    for part, vertices in posed.items():
        _write(skin, objects[part], vertices - following.neutral[part])
    return following


def _current(skin, moving: bool) -> Following | None:
    """The simulation of this head, made where there is none; a head at rest that never moved needs none."""
    keys = skin.data.shape_keys
    if not moving and (keys is None or KEY not in keys.key_blocks):
        return None
    mark = response.fingerprint(skin)
    following = kept.get(skin.session_uid)
    instant = skin.headshop.model == "INSTANT" and response.is_current(skin, mark)
    acting = INSTANT if instant else model_named(MODELS[skin.headshop.model])
    if following is not None and (following.fingerprint, following.acting) == (mark, acting):
        return following
    from ..sim.acting.pose import Pose, control
    from ..sim.tissue.posing import posed_parts

    model = response.acted(skin, mark) if instant else acting.build(heads.read_head(skin))
    state = acting.rest_state(model)
    following = Following(
        acting, mark, model, posed_parts(model, state, control(model, Pose())), state, acting.follower(model)
    )
    kept[skin.session_uid] = following
    return following


def _write(skin, obj, delta):
    """Set the part's ``Live`` key to its rest shape plus ``delta`` (n, 3) mm, given in the skin's space.

    A part that stayed linked, where the skin alone was overridden, stays as it is.
    """
    if obj.data.library is not None:
        return
    if obj != skin and KEY not in (obj.data.shape_keys.key_blocks if obj.data.shape_keys else ()):
        if np.abs(delta).max(initial=0.0) < STILL:
            return
    block = bridge.ensure_shape_key(obj, KEY)
    turn = np.linalg.inv(heads.placement(skin, obj)[:3, :3])
    bridge.write_positions(obj, bridge.read_positions(obj) + delta @ turn.T, KEY)
    if block.value != 1.0:
        block.value = 1.0


def begin_anew() -> None:
    """After undo, redo or loading a file what is kept may speak of other heads; the fingerprint decides."""
    for number, following in list(kept.items()):
        following.pose = None
        following.frames = following.acting.follower(following.model)
        if following.acting is INSTANT:  # what was learnt may be another now
            del kept[number]
