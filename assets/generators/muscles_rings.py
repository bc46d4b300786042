# SPDX-License-Identifier: GPL-3.0-or-later
"""The sphincters of eye and mouth: rings in and about the lids, arcs in the lips (Lee 1995, 3.5; Kähler 2002, 3)."""

import numpy as np

from ...sim.anatomy.head import Eye
from .muscles_points import point
from .muscles_room import Tissue, calmed
from .skull_field import curve

RING_POINTS, ARC_POINTS = 32, 17


def numbers(text: str) -> list[float]:
    """``ring(33,24,27,20)`` -> the numbers."""
    return [float(x) for x in text[text.index("(") + 1 : -1].split(",")]


def lid_rings(text: str, count: int, points, eye: Eye) -> np.ndarray:
    """(count, RING_POINTS, 3) mm: rings in the lids, the first ``far``, the last ``near`` mm beyond the opening.

    They lie on the eyeball where the lids do.
    """
    near, far = numbers(text)
    en, ex, ps, pi = (points[f"k:{n}"] for n in ("en", "ex", "ps", "pi"))
    c, s = _circle()
    middle = (en + ex) / 2
    slope = (ex[2] - en[2]) / (ex[0] - en[0])
    rings = []
    for beyond in np.linspace(far, near, count):
        half = (ex[0] - en[0]) / 2 + np.where(c > 0, beyond, 0.55 * beyond)
        above, below = ps[2] - middle[2] + beyond, middle[2] - pi[2] + beyond
        # pointed at the corners, as the opening is
        lift = np.sign(s) * np.abs(s) ** 1.15
        x, z = middle[0] + half * c, middle[2] + np.where(s > 0, above, below) * lift
        off = np.hypot(x - eye.centre[0], z - eye.centre[2])
        radius = eye.radius + 1.3
        ball = eye.centre[1] - np.sqrt(np.maximum(radius**2 - off**2, 0))
        y = np.where(off < radius * 0.9, ball, np.interp(x, [en[0], ex[0]], [en[1] + 3, ex[1] + 3]))
        rings.append(np.stack([x, y, z + slope * (x - middle[0])], axis=1))
    return _smoothed(np.array(rings), 3)


def orbital_rings(text: str, count: int, points, inner: np.ndarray, tissue: Tissue, share: float) -> np.ndarray:
    """(count, RING_POINTS, 3) mm: rings over the rim of the orbit, the last one the outermost ``inner`` of the lids.

    The text has the outermost ring's half widths: lateral, above, below, medial.
    """
    lateral, above, below, medial = numbers(text)
    centre = (points["k:en"] + points["k:ex"]) / 2
    c, s = _circle()
    x = centre[0] + np.where(c > 0, lateral, medial) * np.sign(c) * np.abs(c) ** 0.92
    z = centre[2] + np.where(s > 0, above, below) * np.sign(s) * np.abs(s) ** 0.92
    outer = tissue.front(np.stack([x, np.full_like(x, centre[1]), z], axis=1))
    part = np.linspace(0, 1, count)[:, None, None]
    rings = outer[None] * (1 - part) + inner[None] * part
    closed = np.concatenate([rings, rings[:, :3]], axis=1)
    feet, normal, deep = tissue.painted(closed)
    placed = feet - np.clip(share * deep, 1.2, 3.5)[..., None] * normal
    placed = np.roll(placed[:, 1:-2], 1, axis=1)
    # toward the lids the rings dive from under the skin to the sheet on the eyeball
    blend = np.clip((part - 0.5) / 0.5, 0, 1) ** 2
    placed = placed * (1 - blend) + (inner[None] + (placed - placed[-1:])) * blend
    placed[-1] = inner
    keep = placed[-1].copy()
    placed = _smoothed(placed, 2)
    placed[-1] = keep
    return placed


def lip_arcs(text: str, count: int, points, tissue: Tissue, share: float) -> np.ndarray:
    """(count, ARC_POINTS, 3) mm from the right modiolus to the left: the marginal fibre first, the peripheral last."""
    first, last = (point(p, points) for p in text[4:-1].split(";"))
    corner = points["k:ch"]
    up = last[2] > corner[2]
    fibres = []
    for part in np.linspace(0, 1, count):
        end = points[f"m:modiolus{int(round(2 - 2 * part if up else 2 + 2 * part))}"]
        middle = first * (1 - part) + last * part
        rise = middle[2] - corner[2]
        side = np.array([corner[0] * 0.5, corner[1] * 0.3 + middle[1] * 0.7, corner[2] + (0.98 - 0.06 * part) * rise])
        near = corner + np.array([0.2 + 3.6 * part, 2.0, (0.62 + 0.03 * part) * rise])
        left = curve([middle, side, near, end], ARC_POINTS // 2 + 1)
        fibres.append(np.concatenate([left[::-1] * [-1, 1, 1], left[1:]]))
    fibres = np.array(fibres)
    lines = tissue.front(fibres.reshape(-1, 3)).reshape(fibres.shape)
    lines[:, [0, -1]] = fibres[:, [0, -1]]
    lines = calmed(lines, 9, 5)
    level, deep = tissue.level(lines)
    placed = lines - np.clip(share * deep, 1.4, 2.5)[..., None] * level
    ends = np.array([f[-1] for f in fibres])
    fade = np.clip((np.linspace(-1, 1, ARC_POINTS) ** 2 - 0.55) / 0.45, 0, 1)[None, :, None] ** 2
    shift = np.where(np.linspace(-1, 1, ARC_POINTS)[None, :, None] > 0, (ends - placed[:, -1])[:, None],
                     (ends * [-1, 1, 1] - placed[:, 0])[:, None])  # fmt: skip
    placed = calmed(placed + fade * shift, 9, 5)
    placed[:, 0], placed[:, -1] = ends * [-1, 1, 1], ends
    return (placed + placed[:, ::-1] * [-1, 1, 1]) / 2


def _circle():
    turn = 2 * np.pi * np.arange(RING_POINTS) / RING_POINTS
    return np.cos(turn), np.sin(turn)


def _smoothed(rings, rounds):
    for _ in range(rounds):
        rings = 0.5 * rings + 0.25 * (np.roll(rings, 1, axis=1) + np.roll(rings, -1, axis=1))
    return rings
