# SPDX-License-Identifier: GPL-3.0-or-later
"""Pursing and protruding forces of a sphincter: Lee, Terzopoulos and Waters 1995, section 5.

"The puckered lips were created by applying radial pursing forces and forward protruding forces to simulate the action of
the orbicularis oris sphincter muscle which circles the mouth."
"""

import numpy as np


def pursing(points: np.ndarray, centre: np.ndarray, forward: np.ndarray, half: np.ndarray) -> np.ndarray:
    """(k, 3) unit vectors inward across ``forward``: square to the ellipse through each point, shorter near its centre.

    half : (3,) mm, half the ring's extent along x, y, z. A drawn fibre presses inward as it is curved: on a wide mouth up
        and down, at its corners to the middle.
    """
    away = points - centre
    steep = away / half**2
    steep = steep - np.outer(steep @ forward, forward)
    size = np.linalg.norm(steep, axis=1, keepdims=True)
    near = np.linalg.norm(away / half, axis=1, keepdims=True)
    return -steep / np.maximum(size, 1e-9) * np.clip(2 * near, 0, 1)


def protruding(points: np.ndarray, centre: np.ndarray, forward: np.ndarray, reach: float) -> np.ndarray:
    """(k, 3) along ``forward`` (unit vector): full at the centre, none beyond ``reach`` mm across it."""
    away = points - centre
    away = np.linalg.norm(away - np.outer(away @ forward, forward), axis=1)
    return np.cos(0.5 * np.pi * np.clip(away / reach, 0, 1))[:, None] ** 2 * forward
