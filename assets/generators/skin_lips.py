# SPDX-License-Identifier: GPL-3.0-or-later
"""Lips: red border and the line where they meet placed on a head, then finished so that they meet."""

import numpy as np

from ...sim.mesh_subdivision import limit
from .skin_curves import even, lerp
from .skin_layout import Layout

#: Border of the red above and below, and the line where the lips meet, (x, z) from the left corner to the middle, mm.
UPPER_RED = [(25.3, -52.9), (20.5, -50.2), (13, -46.3), (6.5, -43.6), (0, -44.4)]

LOWER_RED = [(25.3, -52.9), (20, -56.8), (13, -60.7), (6.5, -62.7), (0, -63.2)]

LIP_LINE = [(24.6, -52.7), (19, -51.9), (12, -51.4), (6, -51.7), (0, -52.3)]

#: Depth y of the line by x, mm.
LIP_DEPTH = ([0, 6, 12, 19, 24.6], [-99.2, -98.9, -96.8, -92.0, -87.2])

# What averaging wore off is given back from here on: sections of adult lips, drawn by hand after norms (vermilion
# 7.5 and 8.7 mm high, mouth 49 mm wide, philtrum 12.4 mm). Nine numbers go from the corner (0) to the middle (8).

#: mm from the midline of the red border, of the middle of the red, of the lips' edge and of the line where they meet.
_X3 = (25.1, 21.6, 18.6, 15.5, 12.4, 9.3, 6.1, 2.9, 0)
_X4 = (24.6, 21.2, 18.2, 15.1, 12.1, 9.0, 6.0, 3.0, 0)
_X5 = (23.8, 20.8, 17.8, 14.8, 11.8, 8.9, 5.9, 2.95, 0)
_X6 = (23.5, 20.5, 17.5, 14.6, 11.7, 8.8, 5.85, 2.9, 0)

#: Height of the line where the lips meet, mm against its middle: the tubercle dips between two gentle arches.
_LINE = (-0.6, -0.1, 0.3, 0.6, 0.8, 0.85, 0.6, 0.15, 0)

#: Height of the red's border over that middle: Cupid's bow above, an even curve below.
_BOW = (-0.6, 1.5, 3.5, 5.2, 6.8, 8.1, 8.9, 8.2, 7.4)
_BASE = (-0.6, -2.7, -4.6, -6.3, -7.5, -8.2, -8.6, -8.7, -8.7)

#: Height of the fullest part of the red.
_FULL_UPPER = (-0.6, 0.7, 1.8, 2.8, 3.6, 4.1, 4.2, 3.7, 3.4)
_FULL_LOWER = (-0.6, -1.4, -2.3, -3.2, -3.9, -4.4, -4.6, -4.6, -4.6)

#: mm behind the middle of the upper border.
_BOW_Y = (18.3, 13.6, 9.8, 6.5, 3.8, 1.7, 0.3, -0.2, 0.1)
_FULL_UPPER_Y = (19.1, 14.2, 10.6, 7.4, 4.7, 2.5, 1.1, 0.4, 0.2)
_BASE_Y = (18.3, 15.1, 12.3, 9.8, 7.7, 6.1, 5.2, 4.8, 4.7)
_FULL_LOWER_Y = (19.1, 14.6, 11.3, 8.3, 6.0, 4.4, 3.5, 3.1, 3.0)
_EDGE_Y = (20.0, 15.3, 11.4, 8.5, 6.2, 4.5, 3.5, 3.0, 2.9)
_LINE_Y = (21.7, 17.0, 13.7, 10.9, 8.8, 7.1, 6.1, 5.6, 5.5)

#: The lips lie against each other this far back from the line, mm; half the gap between them.
_CONTACT = (2.7, 2.8, 3.1, 3.6, 3.9, 4.1, 4.2, 4.3, 4.3)
_GAP = (0, 0.05, 0.03, 0.02, 0.02, 0.02, 0.02, 0.02, 0.02)
_EDGE_GAP = (0, 0.15, 0.22, 0.2, 0.17, 0.15, 0.15, 0.15, 0.15)

#: The surface they touch in arches, so that no straight look gets through: mm up at edge, line and back.
_STEP = (-0.8, 0.6, -0.8)

#: Philtrum on the three rows of skin above the lip, from the middle sideways, groove to column to cheek: mm from the
#: midline, mm behind the middle of the upper border, and how far these numbers rule over what was measured.
_PHILTRUM = {
    0: ((0, 4.2, 8.5, 13.0), (2.1, 2.3, 3.4, 6.6), (0.5, 0.7, 0.8, 0.7)),
    1: ((0, 3.5, 7.0, 11.4), (3.0, 2.8, 2.1, 3.6), (1, 1, 1, 0.6)),
    2: ((0, 3.0, 6.2, 9.4), (1.5, 1.2, 0.6, 1.9), (1, 1, 1, 0.6)),
}

#: mm between the red's border and the next row of skin, as a share of what was measured: near, for a crisp border; and
#: how much of the border's way the row beyond it follows.
_NEAR, _FOLLOW = 0.78, 0.25


#: How eagerly the cage stands out so that the limit surface comes where each row belongs; too much would fold it.
_TRUE = {1: [0, 0.5, 0], 2: [0, 0.4, 0.1], 3: [0.6, 0.6, 0.6], 4: [0.9, 0.9, 0.9]}


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
    for k, (size, back) in ((8, (1.2, 12.0)), (9, (1.3, 24.0)), (10, (1.2, 36.0)), (11, (1.1, 48.0))):
        x[ring[k]] = meet * [size, 1, 1] + np.stack([0 * above, 0 * above + back, above * np.minimum(away, 4) * 2.5], 1)
    patch = layout.patches["mouth"]
    x[patch[1, 1:-1]] = 0.5 * (x[patch[0, 1:-1]] + x[patch[2, 1:-1]]) + [0, 2, 0]


def _section(x, y, z):
    """(32, 3) mm against the middle of the line: each coordinate nine numbers, or (above, below) of nine."""
    i, away, above = lip_places()
    side = np.where((i > 11) & (i < 27), 1.0, -1.0) * ((i != 11) & (i != 27))
    above = above > 0

    def pick(numbers):
        both = np.broadcast_to(numbers, (2, 9))
        return np.where(above, both[0][away], both[1][away])

    return np.stack([side * pick(x), pick(y), pick(z)], axis=1)


def finish_lips(layout: Layout, x: np.ndarray) -> None:
    """Rings 1 to 7 of the mouth: the limit surface takes the sections' form, the cage closes where the lips meet."""
    ring = layout.rings["mouth"]
    _, away, above = lip_places()
    old = x[ring[:8]].copy()
    origin = np.array([0, old[3, 27, 1] - 0.5, 0.5 * (old[6, 27, 2] + old[6, 11, 2])])
    border = origin + _section(_X3, (_BOW_Y, _BASE_Y), (_BOW, _BASE))
    red = origin + _section(_X4, (_FULL_UPPER_Y, _FULL_LOWER_Y), (_FULL_UPPER, _FULL_LOWER))
    edge = origin + _section(_X5, _EDGE_Y, _LINE)
    meet = origin + _section(_X6, _LINE_Y, _LINE)
    back = meet * [0.985, 1, 1] + _section(np.zeros(9), _CONTACT, np.zeros(9))
    for place, gap, step in zip((edge, meet, back), (_EDGE_GAP, _GAP, _GAP), _STEP, strict=True):
        place[:, 2] += above * np.array(gap)[away] + step
    for place in (edge, back):  # in one plane with their neighbours, or the lips' triangles would cut each other there
        for corner, beside in ((19, (18, 20)), (3, (2, 4))):
            here, there = meet[list(beside)].mean(axis=0), place[list(beside)].mean(axis=0)
            normal = np.cross(here - meet[corner], there - meet[corner])
            flat = place[corner, :2] - meet[corner, :2]
            place[corner, 2] = meet[corner, 2] - flat @ normal[:2] / normal[2]
    near = border + _NEAR * (old[2] - old[3])
    beyond = old[1] + _FOLLOW * (border - old[3])
    x[ring[0]] = _with_philtrum(0, old[0], origin)
    target = {1: _with_philtrum(1, beyond, origin), 2: _with_philtrum(2, near, origin), 3: border, 4: red}
    for k, place in (*target.items(), (5, edge), (6, meet), (7, back)):
        x[ring[k]] = place
    eager = np.interp(away, [0, 1, 2], [0, 0.7, 1])  # where rows crowd into the corner it would fold
    smooth = limit(layout.faces, layout.count)
    for _ in range(4):
        now = smooth @ x
        for k, place in target.items():
            x[ring[k]] += eager[:, None] * np.array(_TRUE[k]) * (place - now[ring[k]])


def _with_philtrum(k, row, origin):
    """(32, 3) mm: row ``k`` of skin round the lips with groove and columns above the middle."""
    row = row.copy()
    for step, (aside, behind, rule) in enumerate(zip(*_PHILTRUM[k], strict=True)):
        for i, sign in ((27 - step) % 32, 1), ((27 + step) % 32, -1):
            row[i] = lerp(row[i], np.array([sign * aside, origin[1] + behind, row[i, 2]]), rule)
    return row
