# SPDX-License-Identifier: GPL-3.0-or-later
"""The nose: bridge, tip, columella, wings and nostrils, sculpted where averaging has blurred them."""

import numpy as np

from ...sim.mesh_subdivision import limit
from .skin_curves import lerp
from .skin_layout import Layout

#: Where the limit surface passes: grid (u, v) -> (x, y, z) mm. Our own numbers for an adult mean: widths, height and
#: protrusion after ``measurements_25y.csv``; what these leave open (flat bridge 10 mm wide, two domes, wings with a
#: crease behind them, columella 6 mm) after the usual surface anatomy of the nose.
NOSE = {
    (0, 8): (0, -103.4, 7.5), (1, 8): (3.1, -102.9, 7.6), (2, 8): (6.0, -99.8, 7.7),
    (0, 9): (0, -108.0, -0.2), (1, 9): (3.3, -107.5, 0.0), (2, 9): (6.3, -104.2, 0.3),
    (0, 10): (0, -113.0, -7.2), (1, 10): (3.2, -112.6, -7.1), (2, 10): (6.2, -110.2, -6.9),
    (3, 10): (8.5, -104.2, -6.4), (4, 10): (11.2, -97.2, -6.4), (5, 10): (16.2, -90.1, -7.6),
    (0, 11): (0, -117.4, -13.6), (1, 11): (3.3, -117.0, -13.5), (2, 11): (6.4, -114.6, -13.1),
    (3, 11): (8.5, -109.6, -12.4), (4, 11): (11.0, -102.2, -11.3), (5, 11): (15.1, -91.6, -11.0),
    (0, 12): (0, -120.4, -19.8), (1, 12): (3.6, -119.7, -19.6), (2, 12): (7.3, -116.2, -19.0),
    (3, 12): (9.6, -109.6, -16.8), (4, 12): (12.2, -101.8, -14.0), (5, 12): (15.8, -92.0, -12.8),
    (0, 13): (0, -117.0, -26.2), (1, 13): (3.4, -114.6, -27.0), (2, 13): (5.6, -113.2, -26.6),
    (3, 13): (9.8, -109.4, -25.0), (4, 13): (15.0, -102.6, -19.0), (5, 13): (15.9, -91.0, -16.8),
    (0, 14): (0, -110.0, -30.6), (1, 14): (3.1, -107.2, -29.8), (3, 14): (12.6, -103.6, -26.0),
    (4, 14): (18.0, -97.6, -22.8), (5, 14): (16.2, -89.8, -22.6),
    (0, 15): (0, -102.6, -31.8), (1, 15): (4.6, -101.6, -31.0), (2, 15): (7.9, -98.8, -30.4),
    (3, 15): (11.2, -99.4, -28.8), (4, 15): (14.0, -95.6, -28.8), (5, 15): (15.8, -90.6, -29.0),
    (4, 16): (15.2, -93.2, -33.8),
}  # fmt: skip

#: Grid around the sculpt that says where on a head the nose is: (u, v) -> (x, y, z) mm of the head it was made on.
ANCHORS = {
    (0, 8): (0, -103.2, 7.5),
    (0, 16): (0, -100.8, -36.2),
    (6, 12): (22.7, -87.2, -14.7),
    (6, 14): (23.8, -85.8, -22.8),
}

#: Nostril ring 1.. : share of the way in to the middle, and how far up and back (mm) the cavity has gone there.
CAVITY = ((0.16, (0.0, 0.3, 1.2)), (0.14, (-0.4, 1.5, 5.0)), (0.42, (-1.0, 3.5, 12.0)))


def place_nostril(layout: Layout, x: np.ndarray) -> None:
    """The cavity over the nostril's rim (left side)."""
    ring = layout.rings["nostril_l"]
    rim = x[ring[0]]
    for k, (share, step) in enumerate(CAVITY, start=1):
        x[ring[k]] = lerp(rim, rim.mean(axis=0), share) + step
    x[layout.patches["nostril_l"][1, 1]] = x[ring[len(CAVITY)]].mean(axis=0) + [0, 0, 0.6]


def finish_nose(layout: Layout, x: np.ndarray, rounds: int = 3, gain: float = 0.65) -> None:
    """The nose as sculpted, on the limit surface, at the place and depth where the head has it (left side)."""
    smooth = limit(layout.faces, layout.count)
    anchors = [layout.grid[v, u] for u, v in ANCHORS]
    shift = (smooth[anchors] @ x - np.array(list(ANCHORS.values()), float)).mean(axis=0) * [0, 1, 1]
    index = np.array([layout.grid[v, u] for u, v in NOSE])
    target = np.array(list(NOSE.values()), float) + shift
    x[index] = target
    smooth = smooth[index]
    for _ in range(rounds):
        place_nostril(layout, x)
        x[layout.mirror[layout.left]] = x[layout.left] * [-1, 1, 1]
        x[index] += gain * (target - smooth @ x)
    place_nostril(layout, x)
