# SPDX-License-Identifier: GPL-3.0-or-later
"""Muscles bulge: each segment of a fibre carries an ellipsoid that keeps its volume (Kähler et al. 2001; 2002 drapes a
closed surface over the same segments).

An ellipsoid of length l, width w and height h has the volume pi/6 l w h. The fibres of an array stay beside each other,
so what a segment loses in length it gains in height: h = h_0 l_0 / l. A fibre by itself swells in both ways alike.
"""

import numpy as np


def volume(length, width, height):
    """mm³ of the ellipsoid on a segment."""
    return np.pi / 6 * length * width * height


def swollen(ratio, width, height, beside: bool = True):
    """Width and height (mm) of ellipsoids on segments at ``ratio`` of their rest length, volume kept.

    beside : the fibre lies in an array whose width is held by its neighbours.
    """
    ratio = np.asarray(ratio, float)
    if beside:
        return width * np.ones_like(ratio), height / ratio
    return width / np.sqrt(ratio), height / np.sqrt(ratio)


def rise(ratio, thickness, belly) -> np.ndarray:
    """mm by which the upper side of a muscle rises: half of what its height gains; ``belly`` 0..1 tapers it to its ends."""
    _, height = swollen(ratio, 1.0, thickness)
    return 0.5 * belly * (height - thickness)
