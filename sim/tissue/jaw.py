# SPDX-License-Identifier: GPL-3.0-or-later
"""The hinge of the jaw: rotation about the axis through both condyles while they slide forward and down the articular
eminence; protrusion and sideways motion.

Opening begins as rotation and the slide follows (Posselt's border movement: the first third turns almost purely).
"""

import numpy as np

from ..anatomy.head import Jaw

#: The condyle's path runs down the articular eminence, about 35 degrees under the occlusal plane.
_PATH_SLOPE = np.radians(35.0)
#: Turn about the vertical for a full sideways motion: the working condyle stays, the other comes forward.
_SIDE_YAW = np.radians(4.0)


def _rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)


def jaw_transform(jaw: Jaw, opening: float, forward: float = 0.0, side: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) and translation (3,) mm that carry the closed mandible to the position asked for.

    opening 0..1 of ``open_max``; forward -1..1 of ``forward_max``; side -1..1 of ``side_max``, positive to the left.
    """
    right = jaw.condyle_l - jaw.condyle_r
    axis = right / np.linalg.norm(right)  # to the subject's left
    pivot = (jaw.condyle_l + jaw.condyle_r) / 2
    ahead = jaw.incisor - pivot
    ahead = ahead - (ahead @ axis) * axis
    # the incisors lie forward and below: level the direction by the axis of the condyles and the vertical
    up = np.array([0.0, 0.0, 1.0])
    up = up - (up @ axis) * axis
    up /= np.linalg.norm(up)
    front = ahead - (ahead @ up) * up
    front /= np.linalg.norm(front)
    down_turn = _rotation(axis, float(opening) * jaw.open_max)
    if (down_turn @ ahead - ahead) @ up > 0:  # opening lowers the incisors, whichever way the axis points
        down_turn = down_turn.T
    turn = _rotation(up, float(side) * _SIDE_YAW)
    if (turn @ ahead - ahead) @ axis * side < 0:
        turn = turn.T
    slide = jaw.slide_max * max(0.0, float(opening)) ** 1.5
    path = np.cos(_PATH_SLOPE) * front - np.sin(_PATH_SLOPE) * up
    yawed = (ahead @ front) * np.sin(abs(side) * _SIDE_YAW)
    shift = np.sign(side) * max(0.0, abs(side) * jaw.side_max - yawed) * axis
    shift = shift + slide * path + float(forward) * jaw.forward_max * (np.cos(0.25) * front - np.sin(0.25) * up)
    rotation = turn @ down_turn
    return rotation, pivot + shift - rotation @ pivot


def opening_mm(jaw: Jaw, opening: float) -> float:
    """How far the lower incisors are from where they were, mm."""
    rotation, translation = jaw_transform(jaw, opening)
    return float(np.linalg.norm(rotation @ jaw.incisor + translation - jaw.incisor))
