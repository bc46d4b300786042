# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scan lacks where eyes are: whether that is an eye's whole opening, the slit between shut lids, or nothing.

Of an open eye scanners lose the iris and what lies in the lids' shade, made heads have an empty socket there; of shut ones
they lose at most the line on which the lids meet.
"""

from dataclasses import dataclass

import numpy as np

from ..adapt.closest import Surface
from ..adapt.eye_frame import eye_frame

#: Shares of the way along an eye at which it is looked over, mm above and below, places looked at.
EYE_LINES, ACROSS, LINE = np.linspace(0.25, 0.75, 11), 9.0, 60
SOCKET = 14.0  # mm behind the straight way over the eye: deeper than any eye lies, down to 9 are seen
ENDS = 6  # places at either end of a line that tell where that way begins and ends
CREVICE, BESIDE = 1.5, 1.5  # mm: a place so much deeper than what lies above and below it, within that distance
SPECK, SLIT = 0.5, 3.0  # mm that what is lacking extends over on a line: less is nothing, up to this it is a slit
#: Shares of the lines: of 35 scans of open eyes .45 and more gape where there are holes at all, of 12 of shut ones up to .09,
#: and .41 or more have a slit.
GAPING, SLITS = 0.3, 0.3
SHOWN = 0.5  # share of the lines with something above and below an eye, from which on the scan shows it


@dataclass(frozen=True)
class EyeGaps:
    """gaping, slits : share of the lines over the eyes on which what the scan lacks extends over more than a slit, or over no
    more than one."""

    gaping: float
    slits: float

    @property
    def show_open(self) -> bool:
        """Whether they tell that the eyes are open."""
        return self.gaping >= GAPING

    @property
    def show_shut(self) -> bool:
        """Whether they tell that the eyes are shut."""
        return not self.show_open and self.slits >= SLITS


def eyes_shown(marks, matrix, target: Surface) -> str:
    """The sides, of "lr", of eyes of which a scan shows what is above and below them; both where it does of neither.

    marks : name -> (3,) mm in the scan; matrix (3, 3) turns and scales the reference into it
    """
    shown = [np.isfinite(over_the_eye(_depth(marks, matrix, target, side))).all(axis=1).mean() for side in "lr"]
    return "".join(side for side, share in zip("lr", shown, strict=True) if share > SHOWN) or "lr"


def gaps_in_eyes(marks, matrix, target: Surface, sides: str = "lr") -> EyeGaps:
    """The `EyeGaps` of a scan, in the eyes on these ``sides``; the rest as in `eyes_shown`."""
    depth = np.concatenate([_depth(marks, matrix, target, side) for side in sides])
    lacking = np.isnan(depth) | (depth - over_the_eye(depth) > SOCKET) | crevices(depth)
    first, last = lacking.argmax(axis=1), LINE - 1 - lacking[:, ::-1].argmax(axis=1)
    extent = np.where(lacking.any(axis=1), (last - first + 1) * 2 * ACROSS / (LINE - 1), 0.0)
    gapes = extent > SLIT
    return EyeGaps(float(gapes.mean()), float((~gapes & (extent > SPECK)).mean()))


def _depth(marks, matrix, target, side):
    """(k, n) mm: how far the scan lies behind lines over the eye on that ``side``; NaN where it has nothing."""
    eye = eye_frame(marks, side, matrix)
    return eye.depth(target, eye.lines(EYE_LINES, np.linspace(ACROSS, -ACROSS, LINE)))


def over_the_eye(depth) -> np.ndarray:
    """Depth (k, n) mm of the straight way from the upper to the lower end of each line of ``depth`` (k, n); NaN where an
    end is not seen."""
    top, bottom = np.full((2, len(depth)), np.nan)
    for ends, out in ((depth[:, :ENDS], top), (depth[:, -ENDS:], bottom)):
        seen = np.isfinite(ends).any(axis=1)
        out[seen] = np.nanmedian(ends[seen], axis=1)
    return top[:, None] + np.linspace(0, 1, depth.shape[1]) * (bottom - top)[:, None]


def crevices(depth) -> np.ndarray:
    """(k, n) bool: places on lines of ``depth`` (k, n) mm that lie much deeper than something just above and just below."""
    reach = int(BESIDE / (2 * ACROSS / (LINE - 1))) + 1
    wide = np.pad(np.where(np.isnan(depth), np.inf, depth), ((0, 0), (reach, reach)), constant_values=np.inf)
    nearest = np.lib.stride_tricks.sliding_window_view(wide, reach, axis=1).min(axis=2)
    above, below = nearest[:, : depth.shape[1]], nearest[:, reach + 1 :]
    return depth - np.maximum(above, below) > CREVICE
