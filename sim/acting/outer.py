# SPDX-License-Identifier: GPL-3.0-or-later
"""The channels of a performance that are of the room rather than of the face: the head's place, wind, gravity."""

import numpy as np

from ..tissue.surroundings import STANDARD_GRAVITY, Surroundings
from .head_motion import HeadMotion, felt, rotation
from .turbulence import gusty

PLACE, TURN = ("head_x", "head_y", "head_z"), ("head_turn", "head_nod", "head_tilt")
WIND, TURBULENCE = ("wind_x", "wind_y", "wind_z"), "wind_turbulence"
GRAVITY = ("gravity_x", "gravity_y", "gravity_z")
OUTER = (*PLACE, *TURN, *WIND, TURBULENCE, *GRAVITY)


def head_motion(performance) -> HeadMotion:
    """Where the head is at every frame of a `performance.Performance`."""
    turns = np.array([rotation(*angles) for angles in _table(performance, TURN, np.zeros(3))])
    return HeadMotion(turns, _table(performance, PLACE, np.zeros(3)), performance.fps)


def surroundings(performance, points: np.ndarray, moving: bool = True) -> list[Surroundings]:
    """What acts on the face from outside at every frame; ``points`` (n, 3) mm of the skin at rest.

    moving : with the forces of the head's motion and gusts; else gravity and the steady wind alone
    """
    motion = head_motion(performance)
    wind = None
    if any(name in performance.channels for name in WIND):
        wind = _table(performance, WIND, np.zeros(3))
        share = _table(performance, (TURBULENCE,), np.zeros(1))[:, 0]
        if moving and share.any():
            where = points @ motion.rotations[0].T + motion.positions[0]
            wind = gusty(wind, share, where, np.arange(len(motion)) / performance.fps, performance.seed)
    return felt(motion, _table(performance, GRAVITY, STANDARD_GRAVITY), wind, moving)


def _table(performance, names, missing) -> np.ndarray:
    """(frames, names): values of channels, ``missing`` for those that are not there."""
    out = np.tile(missing, (performance.frame_count, 1))
    for column, name in enumerate(names):
        if name in performance.channels:
            times = np.arange(performance.frame_count) / performance.fps
            out[:, column] = [performance.value(name, time) for time in times]
    return out
