# SPDX-License-Identifier: GPL-3.0-or-later
"""What averaging blurs is made crisp again: lids on the eyeball, lips that meet, nostrils, the relief of the ear.

All work in place on (n, 3) mm positions of the left side and the midline; `finish_shape` mirrors at the end.
"""

import numpy as np

from ...sim.mesh import Mesh, vertex_normals
from ...sim.mesh_subdivision import limit
from .eye_frame import GAP, RADIUS
from .skin_fit import fair
from .skin_layout import HALF, ROWS, Layout
from .skin_rings import lerp, lip_places, unit
from .skin_shape import both_sides

#: Height of the lid margins over the eye's centre, mm: the lower touches the iris, the upper covers its top.
UPPER_MARGIN, LOWER_MARGIN = 4.4, -5.9
#: Half of the distance between the eyes' centres, mm (growth table at 25 years, sexes' mean: 61.6).
HALF_PUPILS = 30.9


def _smooth_outside(layout: Layout, x: np.ndarray) -> np.ndarray:
    """The broad surfaces, freed of the facets of coarse heads; the face's features keep theirs."""
    weight = np.zeros(layout.count)
    for u in range(-HALF + 1, HALF + 1):
        for v in range(ROWS):
            vertex = layout.grid[v, u % (2 * HALF)]
            if vertex < 0:
                continue
            weight[vertex] = np.interp(abs(u), [5, 9], [0, 1])
            if abs(u) <= 8:
                weight[vertex] = max(weight[vertex], 0.6 * (v <= 2 or 26 <= v <= 29))
    weight[layout.crown] = 1
    for side in ("_l", "_r"):
        weight[layout.rings["ear" + side][0]] = 0.3
    weight[layout.grid[-1]] = 0
    return fair(layout, x, weight, 7.0)


def _neck_edge(layout: Layout, x: np.ndarray) -> None:
    """The open edge lies in one plane; the rows above it share the way evenly."""
    first = 26
    for u in range(HALF + 1):
        column = layout.grid[first:, u]
        line = x[column]
        end = np.concatenate([line, line[-1:] + 4 * (line[-1:] - line[-2:-1])])
        height = end[:, 2] - np.interp(end[:, 1], [-18, 100], [-139, -114])
        below = np.flatnonzero(height <= 0)
        if len(below) == 0 or below[0] == 0:
            continue
        k = below[0]
        cut = lerp(end[k - 1], end[k], height[k - 1] / (height[k - 1] - height[k]))
        path = np.concatenate([end[:k], cut[None]])
        length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]
        share = np.r_[0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))]
        at = share / share[-1] * length[-1]
        x[column] = np.stack([np.interp(at, length, path[:, c]) for c in range(3)], axis=1)


def _nose_tip(x: np.ndarray, tip: np.ndarray) -> None:
    """A little of the projection that averaging takes off."""
    near = np.exp(-((x - tip) ** 2).sum(axis=1) / (2 * 9.0**2))
    x += near[:, None] * np.array([0, -1.3, 0.4])


def _nostril_rim(layout: Layout, x: np.ndarray) -> None:
    """The wing's rim hangs over the opening, which is not seen from the front."""
    rim = layout.rings["nostril_l"][0]
    x[rim[[5, 6, 7]]] += np.array([[0.2, -0.1, -0.4], [0.1, -0.3, -0.8], [0, -0.2, -0.6]])
    for (u, v), step in {(4, 13): (0.2, -0.1, -0.2), (4, 14): (0.2, -0.1, -0.1)}.items():
        x[layout.grid[v, u]] += step


def _against_rounding(layout: Layout, x: np.ndarray, strength: float = 0.5) -> np.ndarray:
    """Nose and jaw stand out by what subdivision will round off them: their limit surface is the shape measured."""
    weight = np.zeros(layout.count)
    for u in range(-12, 13):
        for v in range(8, 27):
            vertex = layout.grid[v, u % (2 * HALF)]
            if vertex >= 0:
                nose = np.interp(abs(u), [0, 2, 3, 5, 7], [0.2, 0.4, 1, 1, 0.4]) * np.interp(
                    v, [8, 10, 15, 16], [0, 1, 1, 0.5]
                )
                jaw = np.interp(v, [20, 22, 26], [0, 1, 1]) * np.interp(abs(u), [10, 12], [1, 0])
                weight[vertex] = max(nose, jaw)
    weight[np.concatenate([layout.rings["nostril" + side][0] for side in ("_l", "_r")])] = 1
    smooth = limit(layout.faces, layout.count)
    out = x.copy()
    for _ in range(2):
        out += strength * weight[:, None] * (x - smooth @ out)
    return out


def _lids(layout: Layout, x: np.ndarray) -> None:
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


def _lips(layout: Layout, x: np.ndarray) -> None:
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


def _mouth_bag(layout: Layout, x: np.ndarray) -> None:
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


def _nostril(layout: Layout, x: np.ndarray) -> None:
    ring = layout.rings["nostril_l"]
    rim, up = x[ring[0]], np.array([-1.0, 3.0, 9.0])
    centre = rim.mean(axis=0)
    x[ring[1]] = lerp(rim, centre, 0.20) + [0, 0.15, 1.0]
    x[ring[2]] = lerp(rim, centre, 0.30) + 0.42 * up
    x[ring[3]] = lerp(rim, centre, 0.50) + up
    x[layout.patches["nostril_l"][1, 1]] = x[ring[3]].mean(axis=0) + [0, 0, 0.6]


#: Ear ring -> (indices, mm): how far out of the auricle's plane the relief goes.
_EAR_RELIEF = (
    (6, [0, 3, 7, 8, 10, 12, 14, 17, 19, 20, 22, 23], [0.3, 0, 0, 1.2, 1.8, 0.6, 1.0, 1.4, 1.8, 1.8, 0.9, 0.5]),
    (5, [0, 1, 7, 11, 12, 14, 22, 23], [-1.0, 0, 0, 0, -0.7, -1.3, -1.6, -1.2]),
    (4, [0, 1, 7, 12, 13, 22, 23], [-0.3, 0, 0, 0, -0.5, -0.6, -0.4]),
    (3, [0, 1, 2, 3, 4, 5, 6, 7, 11, 13, 22, 23], [0.2, 0, 0.1, 0.7, 1.2, 0.8, 0.1, 0, 0, 0.5, 0.7, 0.4]),
    (7, [0, 23], [-0.8, -0.8]),
    (8, [0, 23], [-2.2, -2.2]),
)


def _ear(layout: Layout, x: np.ndarray) -> None:
    """Helix, scapha, antihelix, antitragus, tragus, concha."""
    ring = layout.rings["ear_l"]
    normal = vertex_normals(x, Mesh(x, layout.faces).triangles)
    out = unit(normal[ring[5:8]].sum(axis=(0, 1)))
    out = unit(np.array([out[0], min(out[1], 0), 0.05]))
    for k, at, mm in _EAR_RELIEF:
        x[ring[k]] += np.interp(np.arange(24), at, mm)[:, None] * out
    x[ring[3][3:6]] += [0.5, 0.6, 0]
    for k, drop in zip(range(1, 7), (0.8, 1.2, 1.8, 2.6, 1.8, 1.0), strict=True):  # behind the tragus it falls off
        crest = x[ring[3][k]]
        x[ring[4][k]] = crest + [-drop, 0.8, -0.1]
        deep = x[ring[5][k]]
        x[ring[5][k]] = [min(deep[0], crest[0] - 1.6), max(deep[1], crest[1] + 1.5), deep[2]]
    x[layout.patches["ear_l"][1:-1, 1]] -= 2.8 * out


def finish_shape(layout: Layout, vertices: np.ndarray) -> np.ndarray:
    """(n, 3) mm: an averaged head made whole, exactly symmetric."""
    x = both_sides(_smooth_outside(layout, vertices)[layout.left])
    _neck_edge(layout, x)
    _nose_tip(x, x[layout.grid[12, 0]])
    _nostril_rim(layout, x)
    x = both_sides(_against_rounding(layout, both_sides(x[layout.left]))[layout.left])
    _ear(layout, x)
    _nostril(layout, x)
    _lids(layout, x)
    _lips(layout, x)
    _mouth_bag(layout, x)
    return both_sides(x[layout.left])
