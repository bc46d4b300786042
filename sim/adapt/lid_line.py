# SPDX-License-Identifier: GPL-3.0-or-later
"""The creases along an eye: one where shut lids meet, two along the margins of open ones.

A crease is what lies deeper than the skin above and below it, or the slit that a scanner lost there.
"""

from dataclasses import dataclass

import numpy as np

from .closest import Surface
from .eye_frame import eye_frame

#: Shares of the way from the inner to the outer corner of an eye at which creases are looked for, and its middle, where two
#: of them are told apart.
COLUMNS = np.linspace(-0.05, 1.05, 45)
MIDDLE = (COLUMNS > 0.25) & (COLUMNS < 0.75)
FAR, STEP = 11.0, 0.25  # mm above and below the straight way, and from place to place
BESIDE = 2.0  # mm above and below from which a crease is seen to be deeper
DEEPEST = 1.2  # mm: no crease counts for more, and a hole for as much
STRAY = 0.3  # mm of depth that a crease must have more where it is `FAR` from the straight way
STEEP = 2  # places that a crease rises or falls from one column to the next, at most
BEND = 0.12  # mm of depth that each of them costs
#: mm between two creases: the margins of open eyes are 11.0 apart, one deviation 0.9 (`measurements_25y.csv`). What lies
#: farther from the first is the fold of a deep-set lid.
APART, FARTHEST = 3.0, 12.0
PLAIN = 0.7  # mm deep that a crease is that is seen plainly
#: How deep the second creases are against the deepest ones: from .48 on in 20 scans of open eyes, up to .26 in 15 of shut ones
#: and .39 in another, of lids with deep folds.
SECOND = 0.43
NEAR = 4.0  # mm above or below the landmarks of an eye within which a crease is that of its lids


@dataclass(frozen=True, eq=False)
class LidLine:
    """places (k, 3) mm of an eye's deepest crease at `COLUMNS`; depth, second : mm that it, and the next one, is deep."""

    places: np.ndarray
    depth: float
    second: float

    def at(self, share) -> np.ndarray:
        """Places (..., 3) mm at the ``share`` (...) of the way from the inner to the outer corner."""
        return np.stack([np.interp(share, COLUMNS, self.places[:, k]) for k in range(3)], axis=-1)


def lid_line(marks, side: str, target: Surface, matrix) -> LidLine:
    """The `LidLine` of one eye.

    marks : name -> (3,) mm, about where ``en`` and ``ex`` of the ``side`` lie
    matrix (3, 3) turns and scales the reference into the scan's place
    """
    eye = eye_frame(marks, side, matrix)
    heights = np.arange(FAR, -FAR - STEP / 2, -STEP)
    places = eye.lines(COLUMNS, heights)
    depth = eye.depth(target, places)
    worth = crease(depth, int(BESIDE / STEP))
    liked = worth - STRAY * (heights / FAR) ** 2
    columns = np.arange(len(COLUMNS))
    first = best_way(liked)
    away = np.abs(np.arange(len(heights)) - first[:, None]) * STEP
    no_margin = (away < APART) | (away > FARTHEST)
    second = best_way(np.where(no_margin & MIDDLE[:, None], -DEEPEST, liked))
    found = depth[columns, first]
    seen = np.isfinite(found)
    behind = np.interp(COLUMNS, COLUMNS[seen], found[seen]) if seen.any() else np.zeros(len(COLUMNS))
    return LidLine(
        eye.behind(places[columns, first], behind),
        *(float(worth[columns, way][MIDDLE].mean()) for way in (first, second)),
    )


def crease(depth, beside: int) -> np.ndarray:
    """How much deeper (k, n) mm each place of the columns ``depth`` (k, n) lies than the middle of those ``beside`` it."""
    wide = np.pad(depth, ((0, 0), (beside, beside)), constant_values=np.nan)
    around = (wide[:, : depth.shape[1]] + wide[:, 2 * beside :]) / 2
    found = np.where(np.isnan(depth), DEEPEST, np.nan_to_num(depth - around))
    return np.clip(found, 0.0, DEEPEST)


def best_way(worth) -> np.ndarray:
    """Place (k,) in each column of ``worth`` (k, n) of the smooth line worth most (dynamic programming)."""
    columns, places = worth.shape
    steps = np.arange(-STEEP, STEEP + 1)
    total, back = worth[0], np.zeros((columns, places), dtype=int)
    for column in range(1, columns):
        wide = np.pad(total, STEEP, constant_values=-np.inf)
        options = np.stack([wide[STEEP + step : STEEP + step + places] - BEND * abs(step) for step in steps])
        best = options.argmax(axis=0)
        back[column] = steps[best]
        total = options[best, np.arange(places)] + worth[column]
    at = np.zeros(columns, dtype=int)
    at[-1] = total.argmax()
    for column in range(columns - 1, 0, -1):
        at[column - 1] = at[column] + back[column, at[column]]
    return at


def met_at(given, side: str, target: Surface, matrix) -> LidLine | None:
    """The `LidLine` of an eye whose lids the landmarks ``given`` (name -> mm) put together, as `lid_line`; None: it is not seen
    plainly near them."""
    if any(f"{name}_{side}" not in given for name in ("en", "ps", "pi", "ex")):
        return None
    line = lid_line(given, side, target, matrix)
    eye = eye_frame(given, side, matrix)
    middle = (given[f"ps_{side}"] + given[f"pi_{side}"]) / 2
    off = [place - line.at(eye.share(place)) for place in (eye.inner, middle, eye.inner + eye.way)]
    height = np.abs(off @ matrix[:, 2]) / (matrix[:, 2] @ matrix[:, 2])
    alone = line.depth >= PLAIN and line.second < SECOND * line.depth  # where nothing is seen, nothing is
    return line if alone and height.max() < NEAR else None
