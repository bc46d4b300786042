# SPDX-License-Identifier: GPL-3.0-or-later
"""Texture coordinates of the reference skin: one large island cut open at the back, small ones for what lies inside.

Every island is first flattened onto a convex outline (Floater 2003, so nothing overlaps), then the large one is
relaxed to its own lengths (`uv_relax`), the face with more room than the back of the head.
"""

import numpy as np

from .skin_layout import HALF, Layout
from .uv_relax import mean_value, relax

#: Hole -> ring along which its lining is cut off as an island of its own.
CUPS = {"mouth": 6, "eye_l": 6, "eye_r": 6, "nostril_l": 1, "nostril_r": 1}

#: Height of the strip at the bottom that holds the linings.
STRIP = 0.15

#: Texels per mm on the face compared with the back of the head.
FACE_GAIN = 2.4

#: The same on the auricle, whose folds would shrink otherwise.
EAR_GAIN = 1.35

#: The same below the jaw.
BUST_GAIN = 0.6


def _split(quads):
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _spread(vertices, line, start, end):
    """Points along a straight line, spaced like the vertices of ``line``."""
    step = np.linalg.norm(np.diff(vertices[line], axis=0), axis=1)
    t = np.r_[0, np.cumsum(step)] / step.sum()
    return np.asarray(start) + t[:, None] * (np.asarray(end, float) - start)


def _left_half(layout: Layout, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(n, 2): left half of the outer skin, its front midline on x = 0, y upward, in mm of its own."""
    middle = layout.crown.shape[1] // 2
    over = layout.crown[:, middle]  # front to back over the crown
    mouth = layout.rings["mouth"]
    cup = CUPS["mouth"]
    front = np.r_[over[middle::-1], layout.grid[1:16, 0], mouth[: cup + 1, 27]]
    below = np.r_[mouth[cup::-1, 11], layout.grid[23:, 0]]
    neck = layout.edge[: len(layout.edge) // 2 + 1]
    spine = layout.grid[:0:-1, HALF]
    back = np.r_[spine[spine >= 0], over[:middle:-1], over[middle]]
    outline = {}
    for line, start, end in (
        (back, (1, 0), (0, 2)),
        (neck, (0, 0), (1, 0)),
        (front, (0, 2), (0, 0.85)),
        (below, (0, 0.75), (0, 0)),
    ):
        outline.update(zip(line.tolist(), _spread(vertices, line, start, end).tolist(), strict=True))
    triangles, points = _split(faces), vertices
    rims = [layout.rings["eye_l"][CUPS["eye_l"]], layout.rings["nostril_l"][CUPS["nostril_l"]]]
    lips = mouth[cup, 11:28]
    for rim, follows in [(rim, np.roll(rim, -1)) for rim in rims] + [(lips, np.roll(lips, -1))]:
        tip = len(points)  # a fan over each opening keeps its border from folding
        points = np.concatenate([points, vertices[rim].mean(axis=0, keepdims=True)])
        triangles = np.concatenate([triangles, np.stack([rim, follows, np.full(len(rim), tip)], axis=1)])
    flat = mean_value(points, triangles, np.array(list(outline)), np.array(list(outline.values())))
    on_line = np.unique(np.r_[front, below])
    forward = np.clip(-points[triangles].mean(axis=1)[:, 1] / 60 + 0.2, 0, 1)
    trunk = np.interp(points[triangles].mean(axis=1)[:, 2], [-115, -95], [BUST_GAIN, 1])
    gain = (1 + (FACE_GAIN - 1) * forward) * trunk
    gain[np.isin(triangles, layout.rings["ear_l"][1:]).any(axis=1)] *= EAR_GAIN
    weight = 1 + 3 * forward  # openings take the shape that suits their surroundings
    weight[2 * len(faces) :] = 0.1
    weight[len(triangles) - len(lips) :] = 0.03
    return relax(points, triangles, flat, gain, weight, np.intersect1d(on_line, np.unique(triangles)))


def _disc(vertices, quads, rim, centre, radius):
    """(n, 2) of a closed cup whose rim becomes a circle."""
    angle = np.linspace(0, 2 * np.pi, len(rim), endpoint=False)
    ring = np.asarray(centre) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return mean_value(vertices, _split(quads), rim, ring)


def _half_disc(layout, vertices, quads, centre, radius):
    """(n, 2) of the left half of the mouth bag: a half circle on a straight midline."""
    mouth, cup = layout.rings["mouth"], CUPS["mouth"]
    rim = mouth[cup, 11:28]
    angle = np.linspace(-np.pi / 2, np.pi / 2, len(rim))
    arc = np.asarray(centre) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    inside = np.r_[mouth[cup + 1 :, 27], layout.patches["mouth"][1, 7], mouth[:cup:-1, 11]]
    chord = np.r_[rim[-1], inside, rim[0]]
    line = _spread(vertices, chord, (centre[0], centre[1] + radius), (centre[0], centre[1] - radius))[1:-1]
    return mean_value(vertices, _split(quads), np.r_[rim, inside], np.r_[arc, line])


def skin_uv(layout: Layout, vertices: np.ndarray) -> np.ndarray:
    """(m, 4, 2) float32 per face corner, 0..1; the two sides are mirror images about u = 0.5."""
    faces = layout.faces
    half = len(faces) // 2  # the second half of the table mirrors the first
    left = faces[:half]
    hole = np.full(layout.count, "", dtype=object)
    for name, ring in CUPS.items():
        hole[layout.rings[name][ring + 1 :]] = name
        hole[layout.patches[name]] = name
    of_face = np.array([next((h for h in hole[f] if h), "") for f in left])
    uv = np.full((half, 4, 2), np.nan)

    outer = of_face == ""
    flat = _left_half(layout, vertices, left[outer])
    used = np.unique(left[outer])
    low, high = flat[used].min(axis=0), flat[used].max(axis=0)
    scale = min(0.495 / high[0], (0.99 - STRIP) / (high[1] - low[1]))
    uv[outer] = ((flat - [0, low[1]]) * scale + [0.5, STRIP])[left[outer]]

    radius = STRIP / 2 - 0.01
    for name, x, size in (("mouth", 0.5, 1.0), ("eye_l", 0.67, 0.9), ("nostril_l", 0.80, 0.5)):
        own = of_face == name
        centre = (x, STRIP / 2 - 0.003)
        if name == "mouth":
            placed = _half_disc(layout, vertices, left[own], centre, size * radius)
        else:
            placed = _disc(vertices, left[own], layout.rings[name][CUPS[name]], centre, size * radius)
        uv[own] = placed[left[own]]
    uv = np.round(uv, 5)
    mirrored = uv[:, [0, 3, 2, 1]] * [-1, 1] + [1, 0]
    return np.concatenate([uv, mirrored]).astype(np.float32)
