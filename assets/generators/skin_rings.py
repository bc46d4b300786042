# SPDX-License-Identifier: GPL-3.0-or-later
"""First placing of the rings around eyes, mouth, nostrils and ears along contours measured on the same head.

Ring vertices run as in `skin_layout.Block.perimeter`: on the left eye 2 is the inner and 14 the outer corner, 3..13 the
lower lid; around the mouth 3 is the right and 19 the left corner, 11 the middle below and 27 above.
"""

import numpy as np
from scipy.interpolate import CubicSpline

from . import skin_controls
from .skin_layout import Layout
from .skin_rays import MeasuredHead
from .skin_shape import both_sides

#: Lid margins (x, z) from the inner to the outer corner, mm.
UPPER_LID = [(17.6, 14.4), (21, 18.3), (25.5, 21.7), (31.5, 23), (37.5, 22.3), (42, 20), (45, 17.2)]
LOWER_LID = [(17.6, 14.4), (21, 13.6), (25.5, 12.2), (31.5, 11.5), (37.5, 12.2), (42, 14.6), (45, 17.2)]
#: Depth y of the margin's inner edge by x, mm.
MARGIN_DEPTH = ([17.6, 21, 25.5, 31.5, 37.5, 42, 45], [-84.6, -86.5, -88.2, -88.7, -87.2, -83.0, -78.0])

#: Border of the red above and below, and the line where the lips meet, (x, z) from the left corner to the middle, mm.
UPPER_RED = [(25.3, -52.9), (20.5, -50.2), (13, -46.3), (6.5, -43.6), (0, -44.4)]
LOWER_RED = [(25.3, -52.9), (20, -56.8), (13, -60.7), (6.5, -62.7), (0, -63.2)]
LIP_LINE = [(24.6, -52.7), (19, -51.9), (12, -51.4), (6, -51.7), (0, -52.3)]
#: Depth y of the line by x, mm.
LIP_DEPTH = ([0, 6, 12, 19, 24.6], [-99.2, -98.9, -96.8, -92.0, -87.2])


def lerp(a, b, t):
    """Linear mix; ``t`` (k,) goes with the rows of ``a``."""
    t = np.asarray(t, float)
    return a + (b - a) * (t[:, None] if t.ndim == 1 and np.ndim(a) == 2 else t)


def unit(v):
    """Vectors (k, 3) of length 1."""
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def even(points, count):
    """(count, d) evenly spaced points of a cubic curve through ``points``."""
    points = np.array(points, float)
    length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
    fine = CubicSpline(length, points)(np.linspace(0, length[-1], 400))
    along = np.r_[0, np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1))]
    at = np.linspace(0, along[-1], count)
    return np.stack([np.interp(at, along, fine[:, k]) for k in range(points.shape[1])], axis=1)


def lip_places():
    """Around the mouth: index (32,), steps from the nearer corner (32,), +1 above and -1 below (32,)."""
    i = np.arange(32)
    away = np.minimum.reduce([abs(i - 19), 32 - abs(i - 19), abs(i - 3), 32 - abs(i - 3)])
    above = np.where((i > 19) | (i < 3), 1.0, np.where(away == 0, 0.0, -1.0))
    return i, away, above


def _eye(layout, x, head):
    ring = layout.rings["eye_l"]
    orbit = x[ring[0]]
    margin = np.zeros((24, 2))
    for k, (low, up) in enumerate(zip(even(LOWER_LID, 13), even(UPPER_LID, 13), strict=True)):
        margin[(2 + k) % 24] = low
        margin[(2 - k) % 24] = up
    inner = np.stack([margin[:, 0], np.interp(margin[:, 0], *MARGIN_DEPTH), margin[:, 1]], axis=1)
    away = unit(margin - margin.mean(axis=0))
    outer = inner + np.stack([0.35 * away[:, 0], np.full(24, -1.6), 0.35 * away[:, 1]], axis=1)
    for k, t in ((1, 0.66), (2, 0.46), (3, 0.32), (4, 0.16)):
        x[ring[k]] = head.front(lerp(margin, orbit[:, [0, 2]], t))
    x[ring[5]], x[ring[6]] = outer, inner
    middle = inner.mean(axis=0)
    for k, (back, size) in ((7, (6.0, 0.9)), (8, (16.0, 0.7))):
        x[ring[k]] = lerp(np.tile(middle, (24, 1)), inner, size) + [0, back, 0]
    patch = layout.patches["eye_l"]
    x[patch[1, 1:-1]] = 0.5 * (x[patch[0, 1:-1]] + x[patch[2, 1:-1]]) + [0, 3, 0]


def _around(above, below):
    curve = np.zeros((32, 2))
    for k, (up, low) in enumerate(zip(even(above, 9), even(below, 9), strict=True)):
        curve[(19 + k) % 32], curve[19 - k] = up, low
        curve[(3 - k) % 32], curve[3 + k] = up * [-1, 1], low * [-1, 1]
    return curve


def _mouth(layout, x, head):
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


def _nostril(layout, x):
    ring = layout.rings["nostril_l"]
    rim = x[ring[0]]
    for k, (t, up) in ((1, (0.2, 1.0)), (2, (0.35, 3.0)), (3, (0.5, 9.0))):
        x[ring[k]] = lerp(rim, rim.mean(axis=0), t) + [0, 0, up]
    x[layout.patches["nostril_l"][1, 1]] = x[ring[3]].mean(axis=0) + [0, 0, 0.6]


def _ear(layout, x, head):
    ring = layout.rings["ear_l"]
    root = x[ring[0]]
    i = np.arange(24)
    rim, fold = np.array(skin_controls.EAR_RIM, float), np.array(skin_controls.EAR_ANTIHELIX, float)
    concha, middle = np.array(skin_controls.EAR_CONCHA), np.array([8.0, 0.0])
    edge = lerp(rim, middle, 0.04)
    x[ring[3]] = head.left(edge)
    for k, flat in (
        *((4, lerp(rim, fold, 0.28)), (5, lerp(rim, fold, 0.62)), (6, fold)),
        *((7, lerp(fold, concha, 0.3)), (8, lerp(fold, concha, 0.62))),
    ):
        x[ring[k]] = head.left(flat)
    behind = np.interp(i, [0, 7, 9, 11, 20, 22, 24], [0, 0, 0.5, 1, 1, 0.6, 0.2])
    base = np.column_stack([root[:, 0] - 0.5, lerp(rim, np.array([3.0, 0.0]), 0.42)])
    x[ring[1]] = lerp(head.left(lerp(root[:, 1:], rim, 0.55)), base, behind)
    back = x[ring[3]] + np.column_stack([np.full(24, -4.5), lerp(rim, middle, 0.10) - edge])
    x[ring[2]] = lerp(head.left(lerp(root[:, 1:], rim, 0.82)), back, behind)
    patch = layout.patches["ear_l"]
    x[patch[1:-1, 1]] = 0.5 * (x[patch[1:-1, 0]] + x[patch[1:-1, 2]]) - [1.0, 0, 0]


def place_rings(layout: Layout, grid: np.ndarray, head: MeasuredHead) -> np.ndarray:
    """(n, 3) mm: `skin_place.place_grid`'s positions completed by all rings and patches."""
    x = grid.copy()
    _eye(layout, x, head)
    _mouth(layout, x, head)
    _nostril(layout, x)
    _ear(layout, x, head)
    return both_sides(x[layout.left])
