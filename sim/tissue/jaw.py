# SPDX-License-Identifier: GPL-3.0-or-later
"""The hinge of the jaw: rotation about the axis through both condyles while they slide forward and down the articular
eminence; protrusion and sideways motion.

A mouth that opens freely does both from its first millimetre on (motion analyser, doi 10.21203/rs.3.rs-3913755), and the
whole turns about a point well below the condyles, 32 mm by Mehl et al. 2025 (doi 10.1007/s00784-025-06619-4): the slide
is taken for proportional to the angle. Only a jaw held back turns first and slides later, as on Posselt's border.

To the side the jaw turns about the condyle of that side, which stays but for a small shift outward (Bennett), while the
other one slides forward, down and inward. The wider the mouth, the less is left of either (Posselt's envelope of motion).
"""

from functools import lru_cache
from math import atan2, cos, hypot, sin

import numpy as np

from ..anatomy.head import Jaw

#: The condyle's path runs down the articular eminence, degrees under the Frankfort horizontal (mean of adults).
_PATH_SLOPE = np.radians(38.0)
#: Shift of the working condyle, a share of the whole motion to the side (Bennett).
_BENNETT = 0.12
#: From its rest the jaw goes back by this share of what it goes forward: a little less than 1 mm, and level.
_BACKWARD = 0.1
#: Teeth guide the jaw out of their bite: mm by which the incisors go down beside the condyles' own path, at most, on
#: the way forward, back and aside.
_GUIDE = (1.0, 0.85, 2.5)


def _rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    x, y, z = axis.tolist()  # plain numbers: a pose of the response rig has no time for arrays of three
    sine, cosine = sin(angle), cos(angle)
    rest = 1 - cosine
    return np.array(
        [
            [cosine + rest * x * x, rest * x * y - sine * z, rest * x * z + sine * y],
            [rest * x * y + sine * z, cosine + rest * y * y, rest * y * z - sine * x],
            [rest * x * z - sine * y, rest * y * z + sine * x, cosine + rest * z * z],
        ]
    )


def _turn_onto(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(3, 3) the smallest rotation that takes the direction of ``a`` (3,) to that of ``b`` (3,)."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    axis = np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
    size = hypot(*axis)
    if size < 1e-12:
        return np.eye(3)
    return _rotation(axis / size, atan2(size, a @ b))


def left_ahead(opening):
    """How much of the motion forward an open jaw still gives, 0..1 (Posselt's envelope)."""
    return 1 - opening


def left_aside(opening):
    """How much of the motion to the side an open jaw still gives, 0..1."""
    return np.sqrt(1 - opening**2)


@lru_cache(maxsize=8)
def _directions(jaw: Jaw):
    """Axis of the hinge, to the subject's left, mm between the condyles and their middle; from there to the incisors; up,
    to the front, and along the condyles' path."""
    across = jaw.condyle_l - jaw.condyle_r
    width = np.linalg.norm(across)
    axis = across / width
    pivot = (jaw.condyle_l + jaw.condyle_r) / 2
    ahead = jaw.incisor - pivot
    ahead = ahead - (ahead @ axis) * axis
    # The incisors lie forward and below: level the direction by the axis of the condyles and the vertical.
    up = np.array([0.0, 0.0, 1.0])
    up = up - (up @ axis) * axis
    up /= np.linalg.norm(up)
    front = ahead - (ahead @ up) * up
    front /= np.linalg.norm(front)
    path = np.cos(_PATH_SLOPE) * front - np.sin(_PATH_SLOPE) * up
    return axis, width, pivot, ahead, up, front, path


def jaw_transform(jaw: Jaw, opening: float, forward: float = 0.0, side: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) and translation (3,) mm that carry the closed mandible to the position asked for.

    opening 0..1 of ``open_max``; forward -1..1 of ``forward_max``, though backward only a little; side -1..1 of
    ``side_max``, positive to the left. More than the joint gives is not given.
    """
    opening, forward, side = (
        min(max(float(x), low), 1.0) for x, low in ((opening, 0.0), (forward, -1.0), (side, -1.0))
    )
    forward, side = forward * left_ahead(opening), side * left_aside(opening)
    ahead_of, back_of, aside = max(forward, 0.0), max(-forward, 0.0), abs(side)
    ways = (4 * ahead_of * (1 - ahead_of), back_of, aside * (2 - aside))
    guide = (1 - opening) * sum(a * b for a, b in zip(_GUIDE, ways, strict=True))
    axis, width, pivot, ahead, up, front, path = _directions(jaw)
    rotation = _rotation(axis, opening * jaw.open_max + guide / hypot(*ahead))
    if (rotation @ ahead - ahead) @ up > 0:  # opening lowers the incisors, whichever way the axis points
        rotation = rotation.T
    shift = (jaw.slide_max * opening + jaw.forward_max * ahead_of) * path
    shift -= _BACKWARD * jaw.forward_max * back_of * front
    translation = pivot + shift - rotation @ pivot
    if side == 0:
        return rotation, translation
    working, other = (jaw.condyle_l, jaw.condyle_r) if side > 0 else (jaw.condyle_r, jaw.condyle_l)
    bennett = _BENNETT * jaw.side_max * side * axis
    # What the incisors move aside for each mm the other condyle slides: by the turn about the vertical and by the tilt.
    lever = ((ahead @ front) * np.cos(_PATH_SLOPE) - (ahead @ up) * np.sin(_PATH_SLOPE)) / width
    slide = (1 - _BENNETT) * jaw.side_max * abs(side) / lever
    turn = _turn_onto(other - working, other - working + slide * path)
    centre = working + shift
    return turn @ rotation, turn @ (translation - centre) + centre + bennett


def opening_mm(jaw: Jaw, opening: float) -> float:
    """How far the lower incisors are from where they were, mm."""
    rotation, translation = jaw_transform(jaw, opening)
    return float(np.linalg.norm(rotation @ jaw.incisor + translation - jaw.incisor))
