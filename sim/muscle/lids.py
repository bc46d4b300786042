# SPDX-License-Identifier: GPL-3.0-or-later
"""Lids on any mesh: they turn over the eyeball about the line through the corners of the eye (Waters 1986, 3.3.1, 6.3.2).

Heads have lids that meet on a line and follow the gaze: see `tissue.lids`.
"""

import numpy as np

from .jaw import turned


def closed(points: np.ndarray, share: np.ndarray, centre: np.ndarray, axis: np.ndarray, angle: float) -> np.ndarray:
    """(n, 3) mm: points of a lid turned about the eyeball's ``centre`` by ``share`` (n,) of ``angle`` (rad).

    axis : (3,) unit vector from the inner to the outer corner or back; positive angles turn as a right-handed screw
    """
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turned(points, share, rotation, centre - rotation @ centre, centre)
