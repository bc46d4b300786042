# SPDX-License-Identifier: GPL-3.0-or-later
"""The points on the left half of the skull that its parts are modelled round, from the landmarks and a few proportions."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from .skull_depth import BoneSpace
from .skull_field import curve


@dataclass(frozen=True, eq=False)
class SkullMarks:
    """Places (3,) mm on the left side.

    rim : (k, 3) the rim of the orbit, closed, from its medial corner over the top
    eye : middle of the eye opening; apex : deep end of the orbit
    cups : (2, 3) lowest and highest corner of what the lids line behind the eyeball's front
    malar : middle of the cheekbone's body; condyle : middle of the mandible's condyle
    line : (k, 2) y and z of the temporal line as seen from the side, closed, from the brow over the top
    base : z of the skull's base; floor : z of the floor of the nose
    """

    rim: np.ndarray
    eye: np.ndarray
    apex: np.ndarray
    cups: np.ndarray
    malar: np.ndarray
    condyle: np.ndarray
    line: np.ndarray
    base: float
    floor: float


def skull_marks(space: BoneSpace) -> SkullMarks:
    """The `SkullMarks` under a skin."""
    at, skin = space.targets, space.landmarks
    en, ex, n, os, orb = skin["en_l"], skin["ex_l"], at["n"], at["os_l"], at["or_l"]
    eye = (en + ex) / 2
    corners = [
        [en[0] - 3.3, n[1] + 8.5, en[2] + 3.0],
        [en[0] + 0.5, n[1] + 3.8, os[2] - 5.6],
        [eye[0] - 5.5, os[1] - 0.8, os[2] - 0.4],
        [os[0] + 5.0, os[1] + 2.6, os[2] - 1.4],
        [ex[0] - 0.3, ex[1] - 0.6, os[2] - 6.2],
        [ex[0] + 4.4, ex[1] + 7.0, ex[2] + 2.0],
        [ex[0] + 2.0, ex[1] + 7.0, orb[2] + 6.5],
        [orb[0] + 6.5, orb[1] + 1.6, orb[2] + 1.6],
        [orb[0] - 3.5, orb[1] - 1.4, orb[2] + 0.2],
        [en[0] + 1.8, n[1] + 10.2, orb[2] + 5.0],
    ]
    rim = _closed(corners, 96)
    # Far enough under the skin to keep its thickness.
    away = rim[:, [0, 2]] - eye[[0, 2]]
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    least = space.before(rim[:, [0, 2]] + 2.0 * away, 0.9)
    lack = np.maximum(least - rim[:, 1], 0)
    rim[:, 1] += gaussian_filter1d(maximum_filter1d(lack, 7, mode="wrap"), 5, mode="wrap")
    roof = float(space.mouth_limit(np.array([[3.0, at["ans"][1] + 16]]), 1, 6.0)[0])
    line = _closed(
        [
            [rim[:, 1].mean() + 6.0, os[2] - 6.0],
            [at["ft_l"][1] + 1.0, at["ft_l"][2]],
            [at["ft_l"][1] + 22, at["ft_l"][2] + 24],
            [at["eu_l"][1] - 36, at["eu_l"][2] + 30],
            [at["eu_l"][1] + 2, at["eu_l"][2] + 32],
            [at["eu_l"][1] + 34, at["eu_l"][2] + 16],
            [at["eu_l"][1] + 44, at["eu_l"][2] - 14],
            [at["po_l"][1] + 24, at["po_l"][2] + 14],
            [at["po_l"][1] - 10, at["po_l"][2] + 3],
            [at["po_l"][1] - 40, at["po_l"][2] - 20],
            [ex[1] + 16, orb[2] - 12],
        ],
        160,
    )
    return SkullMarks(
        rim=rim,
        eye=eye,
        apex=np.array([13.5, eye[1] + 46.0, eye[2] + 4.5]),
        cups=np.array(space.lid_cups()),
        malar=malar_centre(space),
        condyle=condyle_centre(space),
        line=line,
        base=at["po_l"][2] - 19.0,
        floor=max(at["ans"][2] + 1.2, roof + 6.5),
    )


def malar_centre(space: BoneSpace) -> np.ndarray:
    """(3,) mm, the middle of the left cheekbone's body."""
    ex = space.landmarks["ex_l"]
    return np.array([ex[0] + 3.0, ex[1] + 12.0, space.targets["or_l"][2] - 8.0])


def condyle_centre(space: BoneSpace) -> np.ndarray:
    """(3,) mm, the middle of the left condyle: before and below the porion."""
    return space.targets["po_l"] + [-8.5, -13.0, -6.0]


def _closed(corners, count):
    """(count, d) points on a closed smooth curve through ``corners``."""
    corners = np.asarray(corners, float)
    loop = np.concatenate([corners[-2:], corners, corners[:3]])
    fine = curve(loop, 40 * (len(loop) - 1) + 1)[80 : 80 + 40 * len(corners) + 1]
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1))])
    at = np.linspace(0, length[-1], count, endpoint=False)
    return np.stack([np.interp(at, length, c) for c in fine.T], axis=1)
