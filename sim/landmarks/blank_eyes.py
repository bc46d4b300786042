# SPDX-License-Identifier: GPL-3.0-or-later
"""Blank eyes, as mannequins and statues have them: open, smooth, often flat, and outlined by the margins of their lids.

A skin laid on one takes what lies between the lids for lid. The outline tells: going down, the surface steps back where the
upper lid ends, and forward where the lower one begins. Where shut lids meet it steps back, and nothing outlines them above.
"""

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.optimize import differential_evolution

from ..adapt.closest import Surface
from ..adapt.eye_frame import eye_frame
from .picked import MOVED

#: mm to either side of an eye's middle, above and below it, and from place to place.
ASIDE, ACROSS, STEP = 28.0, 20.0, 0.5
X, Y = np.arange(-ASIDE, ASIDE + STEP / 2, STEP), np.arange(ACROSS, -ACROSS - STEP / 2, -STEP)
SMOOTH, AROUND = 0.8, 4.0  # mm over which the slope is taken, and those over which it counts as the face's own
#: Slope of a step that counts half as much as any, and the steepest.
STEP_SLOPE, STEEPEST = 0.15, 0.6
#: Shares of the way from corner to corner at which margins are looked at.
ALONG = np.linspace(0.06, 0.94, 23)
BOW = 4 * ALONG * (1 - ALONG)
#: Which of those, and shares of the way from lid to lid, at which the eyeball is.
INSIDE, BETWEEN = slice(4, -4), np.linspace(0.25, 0.75, 5)
#: mm that an outline may differ from where an eye is looked for: both corners along the eye, their height, half the difference
#: of their heights, the lower margin in the middle, and from there to the upper one.
BOUNDS = ((-5, 5), (-5, 5), (-6, 7), (-3, 3), (-6, 0), (5, 14))
#: How plain both margins of a blank eye are, 0..1, and how steep against what lies between them. On 21 scans of blank eyes .75
#: and more, 1.7 and more; of 18 others, most of them shut, those as steep are at most .65 plain, those as plain 1.2 steep.
PLAIN, SMOOTHER = 0.7, 1.5
#: mm above the outline that people pick the margins, and the outer corner (of which it tells the height alone). The inner one
#: lies beyond it, and is found better without.
ABOVE = {"ex": 1.0, "ps": 0.0, "pi": 0.0}


def blank_eyes(marks, matrix, target: Surface, sides: str = "lr") -> dict[str, np.ndarray]:
    """Name -> (3,) mm: ``ex``, ``ps`` and ``pi`` of the eyes on these ``sides`` if all of them are blank; else nothing.

    marks : name -> (3,) mm, about where ``en`` and ``ex`` lie; matrix (3, 3) turns and scales the reference into the scan
    """
    eyes = {side: eye_frame(marks, side, matrix) for side in sides}
    seen = {side: eye.depth(target, eye.grid(X, Y)) for side, eye in eyes.items()}
    if not all(np.isfinite(depth).any() for depth in seen.values()):
        return {}
    slopes = {side: slope(depth) for side, depth in seen.items()}
    half = np.mean([np.linalg.norm(eye.way) / eye.scale / 2 for eye in eyes.values()])
    outline = best_outline(np.mean([counted(image) for image in slopes.values()], axis=0), half)
    if not all(is_blank(image, outline) for image in slopes.values()):
        return {}
    out = {}
    for side, eye in eyes.items():
        for name, above in ABOVE.items():
            across = (marks[f"{name}_{side}"] - eye.middle) @ eye.along / eye.scale + MOVED.get(name, (0.0,))[0]
            height = height_of(outline, name, across) + above
            place = eye.grid(np.array([across]), np.array([height]))[0, 0]
            depth = eye.depth(target, place)
            if not np.isfinite(depth):
                return {}
            out[f"{name}_{side}"] = eye.behind(place, depth)
    return out


def slope(depth) -> np.ndarray:
    """How much steeper than around it the surface ``depth`` (r, c) mm, at `Y` and `X`, falls back going down: (r, c)."""
    there = np.isfinite(depth)
    down = np.gradient(_smooth(np.where(there, depth, 0.0), there, SMOOTH), STEP, axis=0)
    return np.where(there, np.clip(down - _smooth(np.where(there, down, 0.0), there, AROUND), -STEEPEST, STEEPEST), 0.0)


def _smooth(image, there, reach):
    """``image`` smoothed over ``reach`` mm, of what is ``there`` (r, c) bool."""
    return gaussian_filter(image, reach / STEP) / np.maximum(gaussian_filter(there.astype(float), reach / STEP), 1e-3)


def counted(image) -> np.ndarray:
    """The slopes of ``image`` as -1..1, steep ones all alike."""
    return image / np.sqrt(image**2 + STEP_SLOPE**2)


def best_outline(image, half: float) -> np.ndarray:
    """(6,) mm: the outline along which the slopes ``image`` (r, c), -1..1, show margins of lids best, with smooth skin inside.

    half : mm from the eye's middle to its corners. An outline is the inner corner's place along the eye and its height, the
    outer corner's, and how far above the straight way between them both margins lie in the middle, the upper one's first.
    """

    def amiss(p):
        upper, lower, between = margins(image, _outlines(p.T, half))
        return between - np.minimum(upper, lower)

    options = {"popsize": 40, "maxiter": 150, "tol": 1e-3, "polish": False, "updating": "deferred", "vectorized": True}
    return _outlines(differential_evolution(amiss, BOUNDS, seed=0, **options).x[None], half)[0]


def _outlines(p, half):
    """Outlines (k, 6) of parameters (k, 6) within `BOUNDS`."""
    tilt = np.array([-1, 1]) * p[:, 3:4] + p[:, 2:3]
    return np.stack([p[:, 0] - half, tilt[:, 0], p[:, 1] + half, tilt[:, 1], p[:, 4] + p[:, 5], p[:, 4]], axis=1)


def margins(image, outlines):
    """Mean of ``image`` (r, c) along the upper margins of ``outlines`` (k, 6), of its negative along the lower ones, and of
    its absolute value between them: three (k,)."""
    x = outlines[:, :1] + (outlines[:, 2:3] - outlines[:, :1]) * ALONG
    way = outlines[:, 1:2] + (outlines[:, 3:4] - outlines[:, 1:2]) * ALONG
    upper, lower = way + outlines[:, 4:5] * BOW, way + outlines[:, 5:6] * BOW
    inner = lower[:, INSIDE] + (upper - lower)[:, INSIDE] * BETWEEN[:, None, None]
    between = _at(image, np.broadcast_to(x[:, INSIDE], inner.shape), inner)
    return _at(image, x, upper).mean(axis=1), -_at(image, x, lower).mean(axis=1), np.abs(between).mean(axis=(0, 2))


def _at(image, x, y):
    """``image`` (r, c) at ``x`` and ``y`` mm."""
    return map_coordinates(image, [(ACROSS - y) / STEP, (x + ASIDE) / STEP], order=1, mode="nearest")


def is_blank(image, outline) -> bool:
    """Whether the slopes ``image`` (r, c) of one eye show margins of lids along the ``outline`` (6,), and nothing inside."""
    upper, lower, _ = margins(counted(image), outline[None])
    plain = min(upper[0], lower[0])
    upper, lower, between = margins(image, outline[None])
    return bool(plain > PLAIN and min(upper[0], lower[0]) > SMOOTHER * between[0])


def height_of(outline, name: str, across: float) -> float:
    """Height mm of what ``name`` names, a corner or a margin, on the ``outline`` (6,), at ``across`` mm along the eye."""
    share = (across - outline[0]) / (outline[2] - outline[0])
    way = outline[1] + share * (outline[3] - outline[1])
    return way + {"ps": outline[4], "pi": outline[5]}.get(name, 0.0) * 4 * share * (1 - share)
