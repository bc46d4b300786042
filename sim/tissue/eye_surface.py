# SPDX-License-Identifier: GPL-3.0-or-later
"""The eyeball as lids and gaze have it: which way it looks, and how far it reaches with its cornea."""

import numpy as np

from ..anatomy.eyeball import reach
from ..anatomy.head import Eye
from .structures import Lids


def eye_profile(eye: Eye) -> tuple[np.ndarray, np.ndarray]:
    """Angle from the gaze (b,) rad and eyeball radius (b,) mm there: the cornea stands out of the sphere."""
    grid = np.linspace(0, np.pi, 181)
    return grid, reach(eye, grid)


def gaze_direction(eye: Eye, gaze: np.ndarray) -> np.ndarray:
    """(3,) unit vector: the rest gaze turned by ``gaze`` rad to the subject's left and up."""
    return gaze_rotation(gaze) @ eye.gaze


def gaze_rotation(gaze: np.ndarray) -> np.ndarray:
    """(3, 3): first up about the left-right axis, then left about the vertical."""
    left, rise = float(gaze[0]), float(gaze[1])
    c, s = np.cos(left), np.sin(left)
    yaw = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    c, s = np.cos(-rise), np.sin(-rise)
    pitch = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return yaw @ pitch


def eyeball_radius(lids: Lids, points: np.ndarray, gaze: np.ndarray) -> np.ndarray:
    """(k,) mm: how far the eyeball reaches from its centre toward ``points`` (k, 3)."""
    rel = points - lids.eye.centre
    size = np.maximum(np.linalg.norm(rel, axis=1), 1e-9)
    angle = np.arccos(np.clip(rel @ gaze_direction(lids.eye, gaze) / size, -1, 1))
    return np.interp(angle, lids.profile_angle, lids.profile)


def depth_in_eyeballs(lids_of_both, skin: np.ndarray, gaze_of) -> float:
    """mm by which skin (n, 3) reaches deepest into an eyeball, beyond what it does at rest; 0 where it does not.

    lids_of_both : a model's `Lids`; gaze_of(side) -> (2,) rad
    """
    deepest = 0.0
    for lids in lids_of_both:
        points = skin[lids.contact_column]
        gap = np.linalg.norm(points - lids.eye.centre, axis=1) - eyeball_radius(lids, points, gaze_of(lids.side))
        deepest = max(deepest, float((np.minimum(lids.clearance, 0) - gap).max(initial=0.0)))
    return deepest
