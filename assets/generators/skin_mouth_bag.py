# SPDX-License-Identifier: GPL-3.0-or-later
"""The lining of the mouth: vestibule and hollow in one bag behind the lips."""

import numpy as np

from .skin_layout import Layout


def mouth_bag(layout: Layout, x: np.ndarray) -> None:
    """Behind the lips up and down over the teeth, wide past the molars, 43 mm deep."""
    ring = layout.rings["mouth"]
    corner, height, front = x[ring[6][19]], x[ring[6][27], 2], x[ring[7][27], 1]
    angle = (np.arange(32) - 19) * 2 * np.pi / 32
    c, s = (np.sign(f) * np.abs(f) ** 0.75 for f in (np.cos(angle), np.sin(angle)))
    wide = corner[0] + 3.0
    for k, half_width, half_height, down, (at, depth) in (
        (8, wide, 9.0, 0.3, ([0, 8, 16, wide], [front + 1.2, front + 2.0, front + 6.5, corner[1] + 8.5])),
        (9, 32.0, 14.5, 0.8, ([0, 10, 20, 32], [front + 13, front + 14, front + 20, front + 32])),
        (10, 28.5, 12.5, 2.0, ([0, 32], [front + 43, front + 43])),
    ):
        across = half_width * c
        x[ring[k]] = np.stack([across, np.interp(abs(across), at, depth), height - down + half_height * s], axis=1)
    patch = layout.patches["mouth"]
    x[patch[1, 1:-1]] = 0.5 * (x[patch[0, 1:-1]] + x[patch[2, 1:-1]]) + [0, 2, 0]
