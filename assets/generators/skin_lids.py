# SPDX-License-Identifier: GPL-3.0-or-later
"""Lids: their margins placed on a head, then finished so that they lie on the eyeball."""

import numpy as np

from .eye_frame import GAP, RADIUS
from .skin_curves import even, lerp, unit
from .skin_layout import Layout

#: Lid margins (x, z) from the inner to the outer corner, mm.
UPPER_LID = [(17.6, 14.4), (21, 18.3), (25.5, 21.7), (31.5, 23), (37.5, 22.3), (42, 20), (45, 17.2)]

LOWER_LID = [(17.6, 14.4), (21, 13.6), (25.5, 12.2), (31.5, 11.5), (37.5, 12.2), (42, 14.6), (45, 17.2)]

#: Depth y of the margin's inner edge by x, mm.
MARGIN_DEPTH = ([17.6, 21, 25.5, 31.5, 37.5, 42, 45], [-84.6, -86.5, -88.2, -88.7, -87.2, -83.0, -78.0])

#: Height of the lid margins over the eye's centre, mm: the lower touches the iris, the upper covers its top.
UPPER_MARGIN, LOWER_MARGIN = 4.4, -5.9

#: Half of the distance between the eyes' centres, mm (growth table at 25 years, sexes' mean: 61.6).
HALF_PUPILS = 30.9


def place_lids(layout, x, head):
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


def finish_lids(layout: Layout, x: np.ndarray) -> None:
    ring = layout.rings["eye_l"]
    i = np.arange(24)
    inner, outer = np.minimum((i - 2) % 24, (2 - i) % 24), np.minimum((i - 14) % 24, (14 - i) % 24)
    above = (i >= 15) | (i <= 1)
    margin = x[ring[6]].copy()
    share = np.clip((margin[:, 0] - margin[2, 0]) / (margin[14, 0] - margin[2, 0]), 0, 1)
    chord = margin[2, 2] + share * (margin[14, 2] - margin[2, 2])
    height = margin[8, 2] - LOWER_MARGIN
    stretch = (height + UPPER_MARGIN - chord[20]) / (margin[20, 2] - chord[20])
    margin[above, 2] = (chord + (margin[:, 2] - chord) * stretch)[above]
    central = (inner >= 4) & (outer >= 3)
    flat = margin[central][:, [0, 2]] - [HALF_PUPILS, height]
    depth = np.mean(margin[central, 1] + np.sqrt((RADIUS + GAP) ** 2 - (flat**2).sum(axis=1)))
    centre = np.array([HALF_PUPILS, depth, height])

    # inner edge: on the ball, except at the corners
    room = (RADIUS + GAP) ** 2 - ((margin[:, [0, 2]] - centre[[0, 2]]) ** 2).sum(axis=1)
    touch = np.clip(np.minimum((inner - 0.5) / 1.5, outer), 0, 1) * (room > 6)
    margin[:, 1] = lerp(margin[:, 1], centre[1] - np.sqrt(np.maximum(room, 0)), touch)
    margin[14] = [centre[0] + 13.1, centre[1] - 1.2, margin[14, 2]]
    margin[2] = [centre[0] - 14.3, centre[1] - 8.4, margin[2, 2]]
    for k in (13, 15):
        margin[k, 0] = min(margin[k, 0], centre[0] + 11.9)
        left = (RADIUS + GAP) ** 2 - ((margin[k, [0, 2]] - centre[[0, 2]]) ** 2).sum()
        margin[k, 1] = centre[1] - np.sqrt(max(left, 1.0))
    for k, beside in ((1, 0), (3, 4)):
        margin[k] = lerp(margin[2], margin[beside], 0.42)
    away = margin - centre
    margin = centre + away * np.maximum(1, (RADIUS + GAP) / np.linalg.norm(away, axis=1, keepdims=True))
    x[ring[6]] = margin

    # outer edge: the lid's thickness in front of it
    forward = unit(0.75 * unit(margin - centre) + [0, -0.55, 0])
    thick = np.interp(np.minimum(inner, outer), [0, 1, 2, 3], [0.9, 1.3, 1.6, 1.7])
    edge = margin + forward * thick[:, None] + 0.25 * unit((margin - margin.mean(axis=0)) * [1, 0, 1])
    edge[2] = margin[2] + [-1.0, -0.5, 0]
    edge[14] = margin[14] + [1.2, -0.3, 0]
    x[ring[5]] = edge

    # lid plate, crease and fold lie on arcs about the eye from the edge to the orbit
    orbit = x[ring[1]].copy()
    start, end = unit(edge - centre), unit(orbit - centre)
    angle = np.arccos(np.clip((start * end).sum(axis=1), -1, 1))
    old = [x[ring[k]].copy() for k in (4, 3, 2)]
    place = [np.arccos(np.clip((unit(p - centre) * start).sum(axis=1), -1, 1)) / angle for p in old]
    place = np.stack([np.zeros(24), *place, np.ones(24)], axis=1)
    radius = np.stack([np.linalg.norm(p - centre, axis=1) for p in (edge, *old, orbit)], axis=1)
    open_ = np.clip((np.minimum(inner, outer) - 0.3) / 2.0, 0, 1)
    straight = np.clip((np.minimum(inner, 1.4 * outer) - 0.2) / 2.2, 0, 1)

    def on_arc(upper_mm, lower_mm, most):
        t = np.clip(np.where(above, upper_mm, lower_mm) / (14.5 * angle), 0, most)
        a, b = np.sin((1 - t) * angle) / np.sin(angle), np.sin(t * angle) / np.sin(angle)
        direction = a[:, None] * start + b[:, None] * end
        return direction, np.array([np.interp(t[k], place[k], radius[k]) for k in range(24)])

    plate, r4 = on_arc(2.5, 2.2, 0.25)
    crease, r3 = on_arc(5.2, 5.0, 0.45)
    fold, r2 = on_arc(7.4, 8.0, 0.66)
    r4 = lerp(r4, np.full(24, RADIUS + 2.0), 0.8 * open_)
    r3 = lerp(r3, np.where(above, RADIUS + 2.25, RADIUS + 2.7), np.where(above, 0.75, 0.5) * open_)
    r2 = np.maximum(r2, RADIUS + 2.6) + open_ * np.where(above, 0.7, 0.25)
    for k, direction, distance, t in ((4, plate, r4, 0.18), (3, crease, r3, 0.38), (2, fold, r2, 0.64)):
        x[ring[k]] = lerp(lerp(edge, orbit, t), centre + direction * distance[:, None], straight)

    # back of the lids: a cup around the eyeball
    around = np.pi + (i - 2) * 2 * np.pi / 24
    for k, degrees in ((7, 80), (8, 128)):
        a = np.radians(degrees)
        circle = np.stack([np.sin(a) * np.cos(around), np.full(24, -np.cos(a)), np.sin(a) * np.sin(around)], axis=1)
        x[ring[k]] = centre + (RADIUS + 0.8) * circle
    for k, t in ((2, 0.55), (1, 0.4), (3, 0.4)):
        x[ring[7][k]] = lerp(x[ring[7][k]], margin[k] + [0.8, 1.6, 0], t)
    x[ring[7][14]] = lerp(x[ring[7][14]], margin[14] + [0, 1.5, 0], 0.6)
    for k in (13, 15):
        x[ring[7][k]] = centre + unit(unit(margin[k] - centre) + [0, 0.35, 0]) * (RADIUS + 0.9)
    patch = layout.patches["eye_l"]
    x[patch[1, 1:-1]] = 0.5 * (x[patch[0, 1:-1]] + x[patch[2, 1:-1]]) + [0, 4.0, 0]
