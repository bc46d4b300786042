# SPDX-License-Identifier: GPL-3.0-or-later
"""The line on which closed lips meet: a crease, or a slit that a scanner lost, as long as the mouth is wide.

No shape of a neutral head tells how wide a mouth is, but the crease ends at its corners. It is followed from the middle
as the line of shut lids is (`sim.adapt.lid_line`), and ends where what it is deeper than the skin beside it adds up to most.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from ..adapt.closest import Surface
from ..adapt.lid_line import best_way, crease
from ..relax.mouth_gap import depths
from ..relax.smile import CORNERS
from .mouth_outline import NARROW, NEAR, mouth_arch

ASIDE, STEP = 0.5, 0.25  # mm from column to column, and from place to place in one
WIDE, FAR = 44.0, 9.0  # mm to either side of the middle, and above and below where lips are taken to meet
BESIDE = 2.0  # mm above and below from which the crease is seen to be deeper
FARTHER = 17.0  # mm: the same of lips of which nobody knows where about they are
STRAY = 0.3  # mm of depth that it must have more where it is as far off as can be
ALONG = 9  # columns over which it is averaged
#: mm deep that the crease is between lips, and less beyond their corners. Of 38 closed mouths corners were 1.5 mm off on
#: average, 5 at most; with .5 wrinkles went on with it (2.5 mm, 15 at most), with .8 a weak line ended 23 mm too soon.
PLAIN = 0.75
#: The same of a line that fades, as that of a soft scan does, up to where a shape laid on the scan has the corner. In 15 scans
#: fused in voxels of 1.2 to 3 mm corners were 6.0 mm off without this, 19 at most, and are 2.5 and 4.6; in ten sharper ones .98
#: and 1.2.
FADING = 0.35
ASTRAY = (
    14.0  # mm beyond the corner of the shape: so far a line goes on along a furrow, of a beard for one, to no corner
)
MIDDLE = 10.0  # mm to either side of the middle where it must be as deep
AROUND = 4  # columns beside a corner that tell how deep it lies, and must not lie in a hole
#: mm behind where they are taken to meet: what lies deeper between lips is no lip, but mouth that shows through. In the 15
#: scans of 42 that show where closed ones meet they did from 4 mm before to 6 mm behind; what showed through lay 14 behind.
WITHIN = 9.0
SLIT = 4.0  # mm from above to below of what a scanner loses between lips; what is wider is a hole, and tells nothing
#: mm between corners below which the line ended before them. The narrowest of twelve mouths of known width has 41; a
#: mannequin's of few triangles, 63 wide, is a crease of .75 mm for 26.
NARROWEST = 33.0
END = 3.0  # mm above and below the line within which a scan that ends leaves open how deep it is


@dataclass(frozen=True, eq=False)
class LipLine:
    """corners : ``ch_l`` and ``ch_r`` -> (3,) mm, where the line ends, those that are seen; middle (3,) mm : of the line."""

    corners: dict[str, np.ndarray]
    middle: np.ndarray

    @property
    def marks(self) -> dict[str, np.ndarray]:
        """Name -> (3,) mm: the corners, and ``sto`` in the middle of the line."""
        return self.corners | {"sto": self.middle}


def lip_line(target: Surface, marks, forward, scale: float = 1.0) -> LipLine | None:
    """The `LipLine` of a scan with closed lips; None: it is not seen plainly.

    marks : name -> (3,) mm, where about ``sto``, ``ch_l`` and ``ch_r`` lie; forward : (3,) unit vector, out of the face;
    scale : mm on the scan per mm of the reference
    """
    aside, worth, depth, places, hole = _followed(target, marks, forward, scale, FAR)
    if worth[np.abs(aside) < MIDDLE].mean() < PLAIN:
        return None
    corners = {}
    laid = [_aside(marks, name, forward, scale) for name in CORNERS]
    ends = fading_ends(worth, aside, laid)
    for name, end, corner in zip(CORNERS, ends, laid, strict=True):
        if abs(aside[end]) > corner + ASTRAY:
            continue
        found = target.closest((places[end] - scale * _behind(depth, end) * forward)[None], NEAR * scale)
        if found.found[0] and not hole[max(end - AROUND, 0) : end + AROUND + 1].any():
            corners[name] = found.points[0]
    wide = np.ptp(ends) * ASIDE
    if not corners or wide < NARROW:
        return None
    short = len(corners) == 2 and wide < NARROWEST
    return LipLine({} if short else corners, _middle(depth, places, forward, scale))


def lip_height(target: Surface, marks, forward, scale: float = 1.0) -> np.ndarray | None:
    """(3,) mm: the middle of the nearest crease up to `FARTHER` above or below where the lips of a face that was laid on
    the scan are, which may have missed them; None: there is none. Parameters as of `lip_line`."""
    aside, worth, depth, places, _ = _followed(target, marks, forward, scale, FARTHER)
    if worth[np.abs(aside) < MIDDLE].mean() < PLAIN:
        return None
    return _middle(depth, places, forward, scale)


def _followed(target, marks, forward, scale, far):
    """The line worth most up to ``far`` above and below the middle: mm aside (c,) of the middle; what each place of it is worth
    and how deep it lies, mm (c,); the places (c, 3) mm in front of it; whether the scan has a hole there, or ends near it (c,).
    """
    aside = np.arange(-WIDE, WIDE + ASIDE / 2, ASIDE)
    heights = np.arange(far, -far - STEP / 2, -STEP)
    arch, up = mouth_arch(marks, "sto", forward, scale * aside)
    places = arch[:, None] + scale * heights[:, None] * up
    depth = depths(target, places.reshape(-1, 3), forward).reshape(places.shape[:2]) / scale
    depth[depth > WITHIN] = np.nan
    missing = missing_run(depth)
    hole = missing > SLIT / STEP
    worth = uniform_filter1d(np.where(hole, 0.0, crease(depth, int(BESIDE / STEP))), ALONG, axis=0)
    way = best_way(worth - STRAY * (heights / far) ** 2)
    columns = np.arange(len(aside))
    hole |= maximum_filter1d(missing, 2 * int(END / STEP) + 1, axis=1) >= depth.shape[1]
    return aside, *(grid[columns, way] for grid in (worth, depth, places, hole))


def _middle(depth, places, forward, scale):
    """(3,) mm, the middle of a line that was `_followed`."""
    middle = len(depth) // 2
    return places[middle] - scale * _behind(depth, middle) * forward


def missing_run(depth) -> np.ndarray:
    """(c, r) how many places in a row are missing around each of the columns ``depth`` (c, r); 0 where it is known. Where
    nothing is known to the end of a column they are as many as it has, or more: nobody knows how far they go on."""
    known, row, many = np.isfinite(depth), np.arange(depth.shape[1]), depth.shape[1]
    before = np.maximum.accumulate(np.where(known, row, -many - 1), axis=1)
    after = np.minimum.accumulate(np.where(known, row, 2 * many)[:, ::-1], axis=1)[:, ::-1]
    return np.where(known, 0, after - before - 1)


def line_ends(worth) -> tuple[int, int]:
    """The last columns, to the left and to the right of the middle, of a line as deep as ``worth`` (k,) mm, see `lip_line`.

    Each is where what the line has more than `PLAIN` adds up to most: neither a weak place nor a speck beyond ends it.
    """
    middle = len(worth) // 2
    left = middle + np.cumsum(worth[middle:] - PLAIN).argmax()
    right = middle - np.cumsum(worth[middle::-1] - PLAIN).argmax()
    return int(left), int(right)


def fading_ends(worth, aside, corners) -> list[int]:
    """`line_ends` of a line that is as deep as ``worth`` (k,) mm at ``aside`` (k,) mm of the middle, each followed on while it
    is `FADING` deep, but no farther than a shape has its corner: ``corners`` mm to the left and to the right."""
    ends = []
    for end, corner in zip(line_ends(worth), corners, strict=True):
        step = 1 if end >= len(worth) // 2 else -1
        on = range(end + step, len(worth) if step > 0 else -1, step)
        weak = (k for k in on if worth[k] < FADING or abs(aside[k]) > abs(corner))
        ends.append(next(weak, on.stop) - step)
    return ends


def _aside(marks, name: str, forward, scale) -> float:
    """mm on the reference by which the corner ``name`` lies to either side of the middle of the lips."""
    off = marks[name] - marks["sto"]
    return float(np.linalg.norm(off - off @ forward * forward) / scale)


def _behind(depth, column: int) -> float:
    """The median of what is known of a ``depth`` (k,) around a ``column``; 0 where nothing is."""
    around = depth[max(column - AROUND, 0) : column + AROUND + 1]
    known = around[np.isfinite(around)]
    return float(np.median(known)) if len(known) else 0.0
