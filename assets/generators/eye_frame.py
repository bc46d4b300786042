# SPDX-License-Identifier: GPL-3.0-or-later
"""The eyeballs behind the lids: spheres through the inner edge of the lid margins."""

import numpy as np

from ...sim.anatomy.head import Eye
from .skin_layout import skin_layout

#: Radius of an adult eyeball, mm (axial length 24 mm).
RADIUS = 12.0

#: The inner edge of the margins stays this far in front of the eyeball, mm: the tear film's room.
GAP = 0.25

#: Ring of the eye's hole that is the inner edge of the lid margin.
MARGIN = 6


def eye_frames(vertices: np.ndarray) -> tuple[Eye, Eye]:
    """(left, right) eyes whose spheres the lid margins touch.

    vertices : (n, 3) mm of the reference layout. Margin vertices next to the canthi stand off the ball (caruncle,
    outer corner) and do not count.
    """
    ring = skin_layout().rings["eye_l"][MARGIN]
    size = len(ring)
    spots = [
        i
        for i in range(size)
        if 3 <= min((i - 2) % size, (2 - i) % size) and 2 <= min((i - 14) % size, (14 - i) % size)
    ]
    margin = vertices[ring[spots]]
    centre = margin.mean(axis=0) + [0, RADIUS - 1.5, 0]
    for _ in range(50):  # Gauss-Newton: fixed radius, least squares
        away = centre - margin
        distance = np.linalg.norm(away, axis=1)
        direction = away / distance[:, None]
        step = np.linalg.lstsq(direction, (RADIUS + GAP) - distance, rcond=None)[0]
        centre = centre + step
        if np.linalg.norm(step) < 1e-10:
            break
    gaze = np.array([0.0, -1.0, 0.0])
    mirrored = centre * [-1, 1, 1]
    return Eye(centre, RADIUS, gaze), Eye(mirrored, RADIUS, gaze.copy())
