# SPDX-License-Identifier: GPL-3.0-or-later
"""A head's response rig, kept on its skin: learnt from the simulation once, then a pose takes about a millisecond.

The ID property ``headshop_response`` holds its bytes and ``headshop_response_of`` the fingerprint of the head and of the
simulation that it was learnt from; reshaping the head makes it out of date, and so does a version that simulates otherwise.
"""

import zlib

import bpy
import numpy as np

from ..sim.acting import models
from ..sim.errors import InputError
from ..sim.progress import Work, portion
from ..sim.response.engine import engine_mark
from . import bridge, heads, own_data

RESPONSE = "headshop_response"
OF = "headshop_response_of"


def fingerprint(skin: bpy.types.Object) -> int:
    """A number that changes when the head's rest shape or anatomy does, or the simulation."""
    mark = zlib.crc32(str(skin.get(heads.ANATOMY, "")).encode(), engine_mark())
    for obj in heads.parts_of(skin).values():
        mark = zlib.crc32(np.ascontiguousarray(bridge.read_positions(obj)).tobytes(), mark)
    return mark


def is_prepared(skin: bpy.types.Object) -> bool:
    """Whether a response is kept with the head, up to date or not."""
    return own_data.note(skin, RESPONSE) is not None


def is_current(skin: bpy.types.Object, mark: int | None = None) -> bool:
    """Whether the response kept with the head was learnt on the head as it is and from this simulation; ``mark`` is its
    `fingerprint`, if known."""
    return is_prepared(skin) and own_data.note(skin, OF) == f"{fingerprint(skin) if mark is None else mark:08x}"


def prepare(skin: bpy.types.Object, care: str = "normal") -> Work:
    """Learn the head's response from its simulation and keep it with the head; returns rig, accuracy.

    Closing the generator leaves the head as it was.

    Raises
    ------
    InputError : not a whole head, or linked from another file.
    """
    from ..sim.response.build import build_rig
    from ..sim.response.storage import to_bytes

    if skin.library is not None:
        raise InputError(f"{skin.name!r} is linked from another file: prepare the response in that file.")
    mark = fingerprint(skin)
    rig, accuracy = yield from build_rig(heads.read_head(skin), care)
    own_data.own_meshes(skin)
    own_data.keep_note(skin, RESPONSE, to_bytes(rig, accuracy))
    own_data.keep_note(skin, OF, f"{mark:08x}")
    return rig, accuracy


def stored(skin: bpy.types.Object):
    """The rig kept with the head and what was measured of it.

    Raises
    ------
    InputError : there is none, it cannot be read, or the head was reshaped since, or is simulated otherwise.
    """
    from ..sim.response.storage import from_bytes

    if not is_prepared(skin):
        raise InputError(f"The response of {heads.head_name(skin)!r} was not prepared yet.")
    if not is_current(skin):
        raise InputError(
            f"{heads.head_name(skin)!r} was reshaped since its response was prepared, or another version prepared it: "
            "prepare it again."
        )
    return from_bytes(bytes(own_data.note(skin, RESPONSE)), heads.read_head(skin))


def stored_or_prepared(skin: bpy.types.Object, stop: float) -> Work:
    """The rig kept with the head, or a new one, within the first ``stop`` of the progress; returns rig, accuracy."""
    try:
        return stored(skin)
    except InputError:
        return (yield from portion(prepare(skin), 0.0, stop))


def acted(skin: bpy.types.Object, mark: int | None = None):
    """The `Actor` of a head whose response is up to date, else None."""
    from ..sim.response.actor import actor_of
    from ..sim.response.storage import from_bytes

    if not is_current(skin, mark):
        return None
    head = heads.read_head(skin)
    return actor_of(from_bytes(bytes(own_data.note(skin, RESPONSE)), head)[0], head)


def require_own_model(model: str) -> None:
    """Raise `InputError` where another model than ours is asked to make a rig."""
    if model != models.DEFAULT:
        raise InputError(f"The rig is learnt from the model {models.DEFAULT}: leave out --model {model}.")
