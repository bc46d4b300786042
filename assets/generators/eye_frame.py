# SPDX-License-Identifier: GPL-3.0-or-later
"""The eyeballs behind the lids: spheres through the inner edge of the lid margins."""

import numpy as np

from ...sim.anatomy.eyeball import reach
from ...sim.anatomy.head import Eye
from ...sim.mesh_subdivision import limit
from .skin_layout import skin_layout

#: Radius of an adult eyeball, mm (axial length 24 mm).
RADIUS = 12.0

#: The inner edge of the margins stays this far in front of the eyeball, mm: the tear film's room.
GAP = 0.41

#: The eyeball about its centre.
BALL = Eye(np.zeros(3), RADIUS, np.array([0.0, -1.0, 0.0]))

#: Ring of the eye's hole that is the inner edge of the lid margin.
MARGIN = 6


def eye_frames(vertices: np.ndarray) -> tuple[Eye, Eye]:
    """(left, right) eyes whose globes and corneas the lid margins touch on the limit surface.

    vertices : (n, 3) mm of the reference layout. Margin vertices next to the canthi stand off the ball (caruncle,
    outer corner) and do not count.
    """
    layout = skin_layout()
    ring = layout.rings["eye_l"][MARGIN]
    size = len(ring)
    spots = [
        i
        for i in range(size)
        if 3 <= min((i - 2) % size, (2 - i) % size) and 2 <= min((i - 14) % size, (14 - i) % size)
    ]
    margin = limit(layout.faces, layout.count)[ring[spots]] @ vertices
    centre = margin.mean(axis=0) + [0, RADIUS - 1.5, 0]
    for _ in range(50):  # Gauss-Newton: fixed size, least squares
        away = centre - margin
        distance = np.linalg.norm(away, axis=1)
        direction = away / distance[:, None]
        surface = reach(BALL, np.arccos(np.clip(direction[:, 1], -1, 1)))
        step = np.linalg.lstsq(direction, surface + GAP - distance, rcond=None)[0]
        centre = centre + step
        if np.linalg.norm(step) < 1e-10:
            break
    gaze = np.array([0.0, -1.0, 0.0])
    mirrored = centre * [-1, 1, 1]
    return Eye(centre, RADIUS, gaze), Eye(mirrored, RADIUS, gaze.copy())
