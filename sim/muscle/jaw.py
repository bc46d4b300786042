# SPDX-License-Identifier: GPL-3.0-or-later
"""The jaw: skin turns about the hinge, the corners of the mouth by half the angle (Waters 1986, 4.5.3 and 6.2.2)."""

import numpy as np
from scipy.spatial.transform import Rotation


def jaw_share(points: np.ndarray, hinge: np.ndarray, corners: np.ndarray, taper: float = 12.0) -> np.ndarray:
    """(n,) share 0..1 of the jaw's angle by which each of ``points`` (n, 3) turns, on a mesh without any anatomy.

    The face parts along the plane from the hinge through the corners of the mouth, which keep half the angle: else the
    mouth would open square. Between the corners the lips part at once, beside them over ``taper`` mm to either side.

    hinge, corners : (2, 3) mm, left and right: ends of the axis before the ears; corners of the mouth
    """
    axis = hinge[0] - hinge[1]
    axis = axis / np.linalg.norm(axis)
    middle = hinge.mean(axis=0)
    ahead = corners.mean(axis=0) - middle
    ahead -= (ahead @ axis) * axis
    ahead /= np.linalg.norm(ahead)
    down = np.cross(ahead, axis)  # right-handed: left, back, up
    down = -down if down[2] > 0 else down
    away = points - middle
    half_mouth = max(np.abs((corners - middle) @ axis).mean(), 1e-9)
    width = taper * np.clip(np.abs(away @ axis) / half_mouth, 1e-6, 1) ** 2
    below = _smooth(0.5 + (away @ down) / (2 * width))
    return below * _smooth((away @ ahead) / taper)


def turned(points: np.ndarray, share: np.ndarray, rotation, translation, pivot) -> np.ndarray:
    """Points (n, 3) mm moved by ``share`` (n,) of a rigid motion: of its angle about the axis through ``pivot`` (3,).

    rotation (3, 3), translation (3,) mm : of the mandible. Turning by part of the angle keeps the distance from the axis;
    blending positions would shrink it.
    """
    share = share[:, None]
    turn = Rotation.from_rotvec(share * Rotation.from_matrix(rotation).as_rotvec())
    return turn.apply(points - pivot) + pivot + share * (translation + rotation @ pivot - pivot)


def _smooth(x):
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)
