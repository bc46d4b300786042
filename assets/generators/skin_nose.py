# SPDX-License-Identifier: GPL-3.0-or-later
"""Tip and wings of the nose, nostrils."""

import numpy as np

from .skin_curves import lerp
from .skin_layout import Layout


def place_nostril(layout, x):
    ring = layout.rings["nostril_l"]
    rim = x[ring[0]]
    for k, (t, up) in ((1, (0.2, 1.0)), (2, (0.35, 3.0)), (3, (0.5, 9.0))):
        x[ring[k]] = lerp(rim, rim.mean(axis=0), t) + [0, 0, up]
    x[layout.patches["nostril_l"][1, 1]] = x[ring[3]].mean(axis=0) + [0, 0, 0.6]


def nose_tip(x: np.ndarray, tip: np.ndarray) -> None:
    """A little of the projection that averaging takes off."""
    near = np.exp(-((x - tip) ** 2).sum(axis=1) / (2 * 9.0**2))
    x += near[:, None] * np.array([0, -1.3, 0.4])


def nostril_rim(layout: Layout, x: np.ndarray) -> None:
    """The wing's rim hangs over the opening, which is not seen from the front."""
    rim = layout.rings["nostril_l"][0]
    x[rim[[5, 6, 7]]] += np.array([[0.2, -0.1, -0.4], [0.1, -0.3, -0.8], [0, -0.2, -0.6]])
    for (u, v), step in {(4, 13): (0.2, -0.1, -0.2), (4, 14): (0.2, -0.1, -0.1)}.items():
        x[layout.grid[v, u]] += step


def finish_nostril(layout: Layout, x: np.ndarray) -> None:
    ring = layout.rings["nostril_l"]
    rim, up = x[ring[0]], np.array([-1.0, 3.0, 9.0])
    centre = rim.mean(axis=0)
    x[ring[1]] = lerp(rim, centre, 0.20) + [0, 0.15, 1.0]
    x[ring[2]] = lerp(rim, centre, 0.30) + 0.42 * up
    x[ring[3]] = lerp(rim, centre, 0.50) + up
    x[layout.patches["nostril_l"][1, 1]] = x[ring[3]].mean(axis=0) + [0, 0, 0.6]
