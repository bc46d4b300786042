# SPDX-License-Identifier: GPL-3.0-or-later
"""The lining of the mouth: vestibule and hollow in one bag behind the lips."""

import numpy as np

from .skin_curves import even
from .skin_layout import Layout

#: Rings of the bag: half outline seen from the front, (x, z) mm from the middle above to the side and from there to the
#: middle below, z against the line of the lips; and y behind the back of the lips by x. The first turns from the lips' backs
#: into roof and floor, the second lies at the molars, the third borders the back wall.
_OUTLINES = {
    8: (
        [(0, 16.2), (10, 16.0), (18, 14.4), (24.5, 9.5), (27.0, -1.6)],
        [(27.0, -1.6), (25.8, -8.4), (20, -13.8), (10, -15.6), (0, -16.0)],
    ),
    9: (
        [(0, 16.6), (14, 16.4), (25, 14.2), (32, 8.0), (33.0, -1.0)],
        [(33.0, -1.0), (32, -9.0), (26, -16.5), (14, -19.5), (0, -20.3)],
    ),
    10: (
        [(0, 13.6), (12, 13.0), (22, 11.0), (28.5, 6.0), (29.5, -1.5)],
        [(29.5, -1.5), (28.5, -9), (22, -15), (12, -17), (0, -17.5)],
    ),
}
_DEPTHS = {
    8: ([0, 8, 16, 24, 27], [2.2, 3.4, 8.0, 15.5, 17.5]),
    9: ([0, 12, 24, 33], [25.0, 25.5, 28.0, 32.0]),
    10: ([0, 30], [49.0, 49.0]),
}
#: mm by which the floor's front lies farther back than the roof's: the lower lip is thicker.
_LOWER_BACK = {8: 4.5, 9: 0.0, 10: 0.0}


def mouth_bag(layout: Layout, x: np.ndarray) -> None:
    """Behind the lips up and down over the gums, wide past the molars, 46 mm deep."""
    ring = layout.rings["mouth"]
    middle, front = 0.5 * (x[ring[6][27], 2] + x[ring[6][11], 2]), x[ring[7][27], 1]
    for k, outline in _OUTLINES.items():
        above, below = (even(side, 9) for side in outline)
        half = np.concatenate([above, below[1:]])  # from the middle above (index 27) to the middle below (11)
        around = np.zeros((32, 2))
        for step, place in enumerate(half):
            around[27 - step], around[(27 + step) % 32] = place, place * [-1, 1]
        y = front + np.interp(abs(around[:, 0]), *_DEPTHS[k]) + _LOWER_BACK[k] * np.clip(-around[:, 1] / 12, 0, 1)
        x[ring[k]] = np.stack([around[:, 0], y, middle + around[:, 1]], axis=1)
    patch = layout.patches["mouth"]
    x[patch[1, 1:-1]] = 0.5 * (x[patch[0, 1:-1]] + x[patch[2, 1:-1]]) + [0, 2, 0]
