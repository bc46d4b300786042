# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin painted by rule: tone, blood, freckles, lips, brows, lids, the shadow of shaved hair. sRGB per vertex.

Pigment and blood absorb as in skin: every effect multiplies linear light by exp(-amount * absorption per channel).
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from .colour_space import to_srgb
from .noise import Noise

#: Linear sRGB albedo of the bare skin (estimates for skin types II to V), hair (linear), iris (linear).
TONES = ((0.60, 0.40, 0.30), (0.52, 0.33, 0.23), (0.40, 0.24, 0.15), (0.24, 0.13, 0.08))
HAIR = ((0.030, 0.017, 0.010), (0.010, 0.007, 0.005), (0.10, 0.055, 0.025), (0.05, 0.02, 0.009))
IRIS = ((0.07, 0.035, 0.015), (0.10, 0.15, 0.19), (0.085, 0.085, 0.045), (0.035, 0.018, 0.009))

#: Absorption per channel of melanin and of blood, relative.
MELANIN = np.array([0.40, 0.75, 1.15])
BLOOD = np.array([0.12, 0.72, 0.48])


@dataclass(frozen=True, eq=False)
class Paint:
    """What was painted: colour (n, 3) float32 sRGB; response (n,) to the scanner's light; gloss (n,)."""

    colour: np.ndarray
    response: np.ndarray
    gloss: np.ndarray


@dataclass(frozen=True)
class Complexion:
    """Which of the palettes a person has."""

    tone: tuple[float, float, float]
    hair: tuple[float, float, float]
    iris: tuple[float, float, float]
    freckles: int
    beard: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> "Complexion":
        """A random person's."""
        tone = int(rng.integers(len(TONES)))
        hair = int(rng.integers(len(HAIR))) if tone < 2 else 1
        iris = int(rng.integers(len(IRIS))) if tone < 2 else 3
        freckles = int(rng.integers(20, 200)) if tone < 2 else 20
        return cls(TONES[tone], HAIR[hair], IRIS[iris], freckles, float(rng.choice([0.0, 0.35, 0.7])))


def paint_skin(points, landmarks, inner, ears, complexion: Complexion, rng: np.random.Generator) -> Paint:
    """Paint the vertices of a skin.

    points (n, 3) mm in standard posture; landmarks : the person's 60; inner, ears (n,) 0..1 : what lies in mouth and
    nostrils, what belongs to the ears
    """
    at = _Places(points, landmarks, ears)
    melanin, blood = _uneven(points, rng)
    blood += 0.30 * at.blob(("or", "ac", "zy"), 21) + 0.22 * at.near("prn", 13) + 0.16 * at.blob(("al", "ac"), 8)
    blood += 0.20 * at.ears + 0.10 * at.near("pg", 13) + 0.08 * at.near("g", 16)
    lids = at.blob(("ps", "pi", "os"), 9.5)
    blood += 0.14 * lids
    melanin += 0.10 * lids + 0.10 * at.blob(("pi", "or", "en"), 9) + 0.08 * at.blob(("en",), 6)
    melanin += 0.05 * at.blob(("ac", "ch"), 9) + 0.5 * _freckles(points, at, complexion.freckles, rng)
    melanin += 0.10 * np.clip((at.z - at.of("gn")[2] - 8) / -25, 0, 1)  # the throat

    lips = _lips(at)
    blood += lips * (0.72 + 0.12 * Noise(rng, 2.0)(points * [1.6, 1, 0.35]))
    melanin += 0.08 * lips
    seam = np.exp(-(((at.z - at.mouth_line()) / 0.9) ** 2)) * at.mouth_width(0.98) * at.front()
    blood += 0.9 * seam
    melanin += 0.5 * seam + 0.2 * inner
    blood += 1.0 * inner

    absorbed = melanin[:, None] * MELANIN + np.clip(blood, -0.3, None)[:, None] * BLOOD + 0.9 * inner[:, None]
    light = np.asarray(complexion.tone) * np.exp(-absorbed)
    fine = Noise(rng, 1.5)
    brows = _brows(at, points, rng)
    lashes = _lashes(at, landmarks)
    scalp = _scalp(at) * (1 + 0.15 * fine(points))
    beard = complexion.beard * _beard(at, lips) * (1 + 0.25 * fine(points))
    hair = np.asarray(complexion.hair)
    for cover in (0.42 * np.clip(scalp, 0, 1), 0.40 * np.clip(beard, 0, 1), 0.92 * np.clip(brows, 0, 1), 0.8 * lashes):
        light = light * (1 - cover[:, None]) + hair * cover[:, None]
    response = (1 - 0.25 * np.clip(scalp, 0, 1)) * (1 - 0.15 * np.clip(brows, 0, 1)) * (1 - 0.3 * lashes)
    gloss = 0.25 + 0.45 * at.near("prn", 12) + 0.3 * at.near("g", 24) + 0.4 * lips
    return Paint(to_srgb(np.clip(light, 0, 1)).astype(np.float32), response * (1 - 0.7 * inner), gloss)


class _Places:
    """Where the vertices are relative to landmarks."""

    def __init__(self, points, landmarks, ears):
        self.points, self.landmarks, self.ears = points, landmarks, np.clip(ears, 0, 1)
        self.x, self.y, self.z = points.T
        self.left = self.x > landmarks["prn"][0]

    def of(self, *names):
        return np.mean([self.landmarks[n] for n in names], axis=0)

    def near(self, name, reach):
        """1 at a landmark, falling to 0 over ``reach`` mm (Gaussian)."""
        return np.exp(-((self.points - self.landmarks[name]) ** 2).sum(axis=1) / (2 * reach**2))

    def blob(self, names, reach):
        """The same about the middle of paired landmarks, on both sides."""
        middles = [self.of(*(n + side for n in names)) for side in ("_l", "_r")]
        return sum(np.exp(-((self.points - m) ** 2).sum(axis=1) / (2 * reach**2)) for m in middles)

    def side(self, name):
        """The landmark of each vertex's own side, (n, 3)."""
        return np.where(self.left[:, None], self.landmarks[name + "_l"], self.landmarks[name + "_r"])

    def front(self):
        """1 in front of the mouth corners, 0 behind: keeps what is painted on the lips off the nape."""
        corner = self.of("ch_l", "ch_r")[1]
        return np.clip((corner + 14 - self.y) / 6, 0, 1)

    def across(self):
        """0 in the middle of the mouth, 1 at the corner of the own side."""
        middle, corner = self.landmarks["sto"], self.side("ch")
        return np.abs(self.x - middle[0]) / np.abs(corner[:, 0] - middle[0])

    def mouth_line(self):
        """Height of the mouth's line over each vertex."""
        t = np.clip(self.across(), 0, 1)
        return self.landmarks["sto"][2] + (self.side("ch")[:, 2] - self.landmarks["sto"][2]) * t**2

    def mouth_width(self, limit):
        return np.clip((limit - self.across()) / 0.08, 0, 1)


def _uneven(points, rng):
    """Blotches of pigment and blood: (n,) each."""
    broad, patchy, small = Noise(rng, 28.0)(points), Noise(rng, 9.0)(points), Noise(rng, 2.6)(points)
    melanin = 0.025 * broad + 0.018 * patchy + 0.030 * small
    blood = 0.04 * Noise(rng, 24.0)(points) + 0.035 * Noise(rng, 7.0)(points) + 0.04 * Noise(rng, 2.2)(points)
    return melanin, blood


def _freckles(points, at, count, rng):
    """Small spots on nose, cheeks and forehead, a few moles anywhere."""
    weight = 0.03 + at.blob(("or", "ac", "zy"), 22) + at.near("se", 20) + 0.4 * at.near("g", 30)
    weight = np.where(at.y < at.of("t_l", "t_r")[1], weight, 0.0)
    chosen = rng.choice(len(points), count + 5, replace=False, p=weight / weight.sum())
    radius = rng.uniform(0.5, 1.1, len(chosen))
    depth = rng.uniform(0.25, 0.9, len(chosen))
    radius[-5:], depth[-5:] = rng.uniform(0.8, 1.5, 5), rng.uniform(1.2, 2.6, 5)
    distance, nearest = cKDTree(points[chosen]).query(points, k=3)
    return (depth[nearest] * np.exp(-((distance / radius[nearest]) ** 2))).sum(axis=1)


def _soft(inside, width):
    """A signed distance (mm, positive within) as 0..1 with an edge of ``width`` mm."""
    t = np.clip(inside / width + 0.5, 0, 1)
    return t * t * (3 - 2 * t)


def _lips(at):
    """The red of the lips from ch, cph, ls, li and sto: curves over the width of the mouth, seen from the front."""
    t = np.clip(at.across(), 0, 1)
    ls, li, sto = (at.landmarks[n] for n in ("ls", "li", "sto"))
    peak, corner = at.side("cph"), at.side("ch")
    p = np.clip(np.abs(peak[:, 0] - sto[0]) / np.abs(corner[:, 0] - sto[0]), 0.05, 0.6)
    bow = ls[2] + (peak[:, 2] - ls[2]) * np.clip(t / p, 0, 1) ** 2
    slope = np.clip((t - p) / (1 - p), 0, 1)
    upper = np.where(t < p, bow, peak[:, 2] + (corner[:, 2] - peak[:, 2]) * (0.75 * slope + 0.25 * slope**2))
    lower = li[2] + (corner[:, 2] - li[2]) * (0.30 * t**2 + 0.70 * t**5)
    within = np.minimum(upper - at.z, at.z - lower)
    return _soft(within + 0.2, 1.6) * np.clip((1.02 - at.across()) / 0.06, 0, 1) * at.front()


def _brows(at, points, rng):
    """Cover 0..1 of the brows: an arc through sci, denser in the middle, of strokes that lie outward and up."""
    g, en, ex, sci, os_ = at.landmarks["g"], at.side("en"), at.side("ex"), at.side("sci"), at.side("os")
    span = np.abs(ex[:, 0] - en[:, 0])
    start, end = np.abs(en[:, 0] - g[0]) * 0.72, np.abs(ex[:, 0] - g[0]) + 0.22 * span
    x = np.abs(at.x - g[0])
    t = (x - start) / (end - start)
    top = (np.abs(sci[:, 0] - g[0]) - start) / (end - start)
    low = os_[:, 2] - 0.3
    height = sci[:, 2] - 2.2
    tail = low - 0.5
    # a parabola through the inner end, the top and the tail
    rise, fall = np.clip(t / top, 0, 1), np.clip((t - top) / (1 - top), 0, 1)
    middle = np.where(t < top, low + (height - low) * (2 * rise - rise**2), height + (tail - height) * fall**1.7)
    thick = 4.0 * np.clip(1 - np.clip(t - 0.45, 0, None) / 0.62, 0.12, 1) * np.clip(0.75 + 2 * t, 0.75, 1)
    inside = thick - np.abs(at.z - middle)
    ragged = Noise(rng, 1.7)
    # strokes: upright near the nose, flat at the tail, always pointing outward
    lean = np.clip(np.radians(66 - 48 * np.clip(t, 0, 1)), 0.2, 1.5)
    above = at.z - middle
    beside = (x - above / np.tan(lean)) * np.sin(lean)
    strokes = Noise(rng, 1.0)(np.column_stack([beside / 0.85, above / 4.0, np.where(at.left, 5.0, 17.0)]))
    cover = _soft(inside + 0.9 * ragged(points), 3.2) * _soft((t + 0.02) * 30, 4) * _soft((1.03 - t) * 30, 5)
    front = at.y < np.maximum(ex[:, 1], sci[:, 1]) + 12
    return cover * np.clip(0.72 + 0.34 * strokes, 0.15, 1) * front


def _lashes(at, landmarks):
    """A dark line along the lid edges, stronger above."""
    out = np.zeros(len(at.points))
    for side in ("_l", "_r"):
        en, ex, ps, pi = (landmarks[n + side] for n in ("en", "ex", "ps", "pi"))
        for middle, depth in ((ps, 0.85), (pi, 0.4)):
            s = np.linspace(0, 1, 40)[:, None]
            control = 2 * middle - 0.5 * (en + ex)
            curve = (1 - s) ** 2 * en + 2 * s * (1 - s) * control + s**2 * ex
            distance, _ = cKDTree(curve).query(at.points, distance_upper_bound=8.0)
            out = np.maximum(out, depth * np.exp(-((np.minimum(distance, 8.0) / 1.1) ** 2)))
    return out


def _scalp(at):
    """Where hair would grow on the head: above a line over trichion, temples and behind the ears."""
    tr, t = at.landmarks["tr"], at.side("t")
    ft = at.side("ft")
    back = np.clip((at.y - tr[1]) / np.maximum(t[:, 1] - tr[1], 1), 0, 1.6)
    # height of the hairline: trichion in front, down the temple before the ear, round behind it to the nape
    line = np.interp(back, [0, 0.35, 0.62, 0.8, 0.97, 1.25, 1.6], [0, -0.10, -0.45, -0.85, -1.05, -1.3, -2.2])
    height = tr[2] + line * (tr[2] - t[:, 2]) - 6 * np.clip(np.abs(at.x) / np.abs(ft[:, 0]) - 0.7, 0, 1)
    cover = _soft(at.z - height, 16)
    return cover * (1 - at.ears) * (at.y > tr[1] - 12)


def _beard(at, lips):
    """Shaved beard: upper lip, chin, jaw up to the ears."""
    sn, ch, go, gn = at.of("sn"), at.side("ch"), at.side("go"), at.of("gn")
    t = at.side("t")
    toward = np.clip((at.y - ch[:, 1]) / np.maximum(t[:, 1] - ch[:, 1], 1), 0, 1)
    top = ch[:, 2] + 6 + (t[:, 2] - 12 - ch[:, 2]) * toward**1.5
    lip = _soft(np.abs(ch[:, 0]) * 1.05 - np.abs(at.x), 12)
    top = top + lip * (np.maximum(top, sn[2] - 1.0) - top)
    cover = _soft(top - at.z, 16) * _soft(at.z - (gn[2] - 24), 26) * (1 - lips) * (1 - at.ears)
    behind = np.maximum(t[:, 1] - 4, go[:, 1])
    return cover * _soft(behind - at.y, 16)
