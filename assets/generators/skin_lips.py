# SPDX-License-Identifier: GPL-3.0-or-later
"""Lips: red border and the line where they meet placed on a head, then finished so that they meet."""

import numpy as np

from .skin_curves import even, lerp
from .skin_layout import Layout

#: Border of the red above and below, and the line where the lips meet, (x, z) from the left corner to the middle, mm.
UPPER_RED = [(25.3, -52.9), (20.5, -50.2), (13, -46.3), (6.5, -43.6), (0, -44.4)]

LOWER_RED = [(25.3, -52.9), (20, -56.8), (13, -60.7), (6.5, -62.7), (0, -63.2)]

LIP_LINE = [(24.6, -52.7), (19, -51.9), (12, -51.4), (6, -51.7), (0, -52.3)]

#: Depth y of the line by x, mm.
LIP_DEPTH = ([0, 6, 12, 19, 24.6], [-99.2, -98.9, -96.8, -92.0, -87.2])


def lip_places():
    """Around the mouth: index (32,), steps from the nearer corner (32,), +1 above and -1 below (32,)."""
    i = np.arange(32)
    away = np.minimum.reduce([abs(i - 19), 32 - abs(i - 19), abs(i - 3), 32 - abs(i - 3)])
    above = np.where((i > 19) | (i < 3), 1.0, np.where(away == 0, 0.0, -1.0))
    return i, away, above


def _around(above, below):
    curve = np.zeros((32, 2))
    for k, (up, low) in enumerate(zip(even(above, 9), even(below, 9), strict=True)):
        curve[(19 + k) % 32], curve[19 - k] = up, low
        curve[(3 - k) % 32], curve[3 + k] = up * [-1, 1], low * [-1, 1]
    return curve


def place_lips(layout, x, head):
    ring = layout.rings["mouth"]
    _, away, above = lip_places()
    outside = x[ring[0]][:, [0, 2]]
    red, line = _around(UPPER_RED, LOWER_RED), _around(LIP_LINE, LIP_LINE)
    for k, flat in (
        *((1, lerp(red, outside, 0.66)), (2, lerp(red, outside, 0.30)), (3, red)),
        *((4, lerp(red, line, 0.5)), (5, lerp(red, line, 0.84))),
    ):
        x[ring[k]] = head.front(flat)
    meet = np.stack([line[:, 0], np.interp(abs(line[:, 0]), *LIP_DEPTH), line[:, 1] + 0.1 * above], axis=1)
    corner = away == 0
    x[ring[4][corner]] = lerp(x[ring[3][corner]], meet[corner], 0.4)
    x[ring[5][corner]] = lerp(x[ring[3][corner]], meet[corner], 0.75)
    x[ring[6]] = meet
    x[ring[7]] = meet * [0.97, 1, 1] + [0, 3.5, 0]
    # a plain sack for now: the lips' finishing gives it its shape once the teeth's room is known
    for k, (size, back) in ((8, (1.2, 12.0)), (9, (1.3, 30.0)), (10, (1.1, 48.0))):
        x[ring[k]] = meet * [size, 1, 1] + np.stack([0 * above, 0 * above + back, above * np.minimum(away, 4) * 2.5], 1)
    patch = layout.patches["mouth"]
    x[patch[1, 1:-1]] = 0.5 * (x[patch[0, 1:-1]] + x[patch[2, 1:-1]]) + [0, 2, 0]


def finish_lips(layout: Layout, x: np.ndarray) -> None:
    ring = layout.rings["mouth"]
    i, away, above = lip_places()
    full = np.interp(away, [0, 1, 2, 4, 8], [0, 0.35, 0.7, 1, 1])
    partner = (38 - i) % 32
    skin, border, red, edge, meet = (x[ring[k]].copy() for k in (2, 3, 4, 5, 6))
    line, front = 0.5 * (meet + meet[partner]), 0.5 * (edge + edge[partner])
    line[:, 1] = lerp(line[:, 1], front[:, 1], 0.9 * full)
    lower = np.where(above < 0, 1.0, 0.0) * full
    upper = np.where(above > 0, 1.0, 0.0) * full
    red += np.stack([0 * full, -1.0 * upper - 1.3 * lower, -0.3 * lower], axis=1)
    edge[:, 1] = lerp(red[:, 1], line[:, 1], 0.36) - 0.3 * upper - 0.2 * lower
    edge[:, 2] = line[:, 2] + 0.95 * upper - 1.2 * lower
    border += np.stack([0 * full, -0.45 * upper - 1.0 * lower, 0.7 * lower], axis=1)
    skin += np.stack([0 * full, 0.2 * upper - 0.1 * lower, 0.3 * lower], axis=1)
    up = np.zeros((32, 3))
    up[:, 2] = above
    back = line * [0.985, 1, 1]
    back[:, 1] += np.interp(away, [0, 2, 8], [1.6, 3.4, 4.6])
    x[ring[2]], x[ring[3]], x[ring[4]], x[ring[5]] = skin, border, red, edge
    x[ring[6]] = line + up * np.interp(away, [0, 1, 8], [0, 0.06, 0.07])[:, None]
    x[ring[7]] = back + up * np.interp(away, [0, 1, 8], [0, 0.08, 0.10])[:, None]
