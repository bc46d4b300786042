# SPDX-License-Identifier: GPL-3.0-or-later
"""The outline of a parted mouth: its corners, where the gap between the lips ends, and the lips' edges in its middle.

How far a smile goes no neutral head tells, but the scan shows it: between parted lips it has nothing, or teeth set back.
From the middle of the mouth that gap is followed to either side, until the lips meet.
"""

from dataclasses import dataclass

import numpy as np

from ..adapt.closest import Surface
from ..relax.mouth_gap import DEEP, SPECK, STEP, bridged_depths, without_islands
from ..relax.parted import APART
from ..relax.smile import CORNERS

ASIDE, DOWN = 1.0, 0.5  # mm from column to column, and from place to place in one
WIDE, ABOVE = 46.0, 12.0  # mm to either side of the middle, and above the upper lip, that are looked at
TOP = int(ABOVE / DOWN)  # places above the upper lip
MIDDLE = np.array([0.0, 2.0, -2.0, 4.0, -4.0])  # mm: columns in which the gap is looked for first
BEHIND = 1.5  # mm: what lies deeper than this behind the line from lip to lip is within the mouth
DRIFT = 1.5  # mm that an edge of the gap may rise or fall from one column to the next
BESIDE = 2.0  # mm above and below the gap within which the lips are looked for
#: mm between lips that are known to be apart, if they are around no hole: noise parts closed ones by 2.9.
LEAST = 4.0
NARROW = 25.0  # mm between corners below which it is no mouth
NOT_WIDE = 32.0  # the same of one that is not where it was expected: nostrils and the furrow under a lip lack data too
NEAR = 6.0  # mm from where the gap ends to the scan
#: mm to either side of the middle within which a mouth is seen whole, and of columns beside a cut that may be seen in part.
HALF, CUT = 30.0, 4.0
FARTHEST = 2 * DEEP  # mm looked behind the upper lip: the lower one of a mouth open in full lies beyond 25
LOWER = 30.0  # mm: how much farther down is looked where a gap goes on below the chin that was expected
#: Lips roll in: where a mouth is open their edges turn back into it, by .8 mm and more in 32 scans, on both lips; around holes
#: that scanners left on a closed one, by .1 at most in 12, on one of them. mm aside of the middle that are looked over, mm
#: beside an edge within which a lip is foremost, mm within that it is followed inward, over steps up to that, mm of roll.
ROLLED_OVER, FOREMOST, INWARD, FOLLOWED, ROLL = 8.0, 5.0, 3.0, 3.5, 0.45
#: Where the scan ends at an edge there is a hole. mm from the edge to the scan; share of its places beside open sides above
#: which the scan ends there: 0 on eleven open mouths, .88 and more on the lower lip of seven closed ones with a hole.
ENDS, ENDED = 2.0, 0.25


@dataclass(frozen=True, eq=False)
class MouthOutline:
    """corners : ``ch_l`` and ``ch_r`` -> (3,) mm; upper, lower (3,) mm : where the lips end in the middle; no_hole : whether
    what parts them is no hole that a scanner left on closed lips: they roll in there, or the scan goes on out of sight behind
    both of them."""

    corners: dict[str, np.ndarray]
    upper: np.ndarray
    lower: np.ndarray
    no_hole: bool

    @property
    def marks(self) -> dict[str, np.ndarray]:
        """Name -> (3,) mm: the corners, and ``sto`` in mid-air half-way between the lips."""
        return self.corners | {"sto": (self.upper + self.lower) / 2}


def mouth_outline(target: Surface, marks, forward, scale: float = 1.0) -> MouthOutline | None:
    """The `MouthOutline` of a scan whose lips are parted; None: there is no gap.

    marks : name -> (3,) mm, where about ``ls``, ``pg``, ``ch_l`` and ``ch_r`` lie; forward : (3,) unit vector, out of the face;
    scale : mm on the scan per mm of the reference
    """
    seen = _seen_whole(target, marks, forward, scale)
    start = middle_gap(seen[1])
    if start is None and goes_on_below(seen[1]):
        lower = _seen_whole(target, marks, forward, scale, LOWER)
        outline = _outline(target, lower, middle_gap(lower[1]), forward, scale)
    else:
        outline = _outline(target, seen, start, forward, scale)
    return outline or _outline(target, seen, large_gap(seen[1]), forward, scale, expected=False)


def _outline(target, seen, start, forward, scale, expected=True) -> MouthOutline | None:
    """The `MouthOutline` around a gap, ``start`` as of `middle_gap`, where one was ``expected``; None: it is no mouth.

    seen : as of `_seen_whole`
    """
    places, depth, unseen = seen
    if start is None:
        return None
    column, *lips = start
    upper, lower = places[column, lips] - scale * depth[column, lips, None] * forward
    corners, told = [], []
    for step in (1, -1):
        end, *lips = gap_end(depth, *start, step)
        told.append(unseen[end])
        behind = depth[end, lips][np.isfinite(depth[end, lips])]
        corners.append(places[end, lips].mean(axis=0) - scale * (behind.mean() if len(behind) else 0.0) * forward)
    found = target.closest(np.array(corners), NEAR * scale)
    corners = np.where(np.array(told)[:, None], corners, found.points)
    narrow = NARROW if expected else NOT_WIDE
    if not (found.found | told).all() or np.linalg.norm(np.subtract(*corners)) < narrow * scale:
        return None
    top = TOP if expected else max(start[1] - TOP // 2, 0)
    gaps = [gap for gap in gaps_about(depth, column, top) if not unseen[gap[0]]]
    no_hole = min(lip_rolls(depth, gaps)) > ROLL or scan_goes_on(target, places, scale * depth, forward, gaps)
    if not no_hole and not (expected and (start[2] - start[1]) * DOWN > APART):
        return None
    return MouthOutline(dict(zip(CORNERS, corners, strict=True)), upper, lower, bool(no_hole))


def _seen_whole(target: Surface, marks, forward, scale: float, lower: float = 0.0):
    """Places (c, r, 3) mm and depths (c, r) mm as of `looked_at`, without islands, and the columns (c,) bool of a side that is
    not seen, which are as those of the other one."""
    places, depth = looked_at(target, marks, forward, scale, lower)
    return places, *both_sides_of(without_islands(depth))


def looked_at(target: Surface, marks, forward, scale: float, lower: float = 0.0):
    """Columns of places (c, r, 3) mm before the mouth, from its right to its left, from above downward to ``lower`` mm below
    the chin, and how deep (c, r) the scan lies behind them, in mm of the reference."""
    aside = scale * np.arange(-WIDE, WIDE + ASIDE / 2, ASIDE)
    arch, up = mouth_arch(marks, "ls", forward, aside)
    above = np.arange(scale * ABOVE, (marks["pg"] - marks["ls"]) @ up - scale * lower, -scale * DOWN)
    places = arch[:, None] + above[:, None] * up
    depth = bridged_depths(target, places.reshape(-1, 3), forward, scale * FARTHEST).reshape(places.shape[:2])
    return places, depth / scale


def both_sides_of(depth):
    """Depths (c, r) mm, see `looked_at`, in which a side of the mouth that a scan does not show is as the other one, and which
    columns (c,) bool that are."""
    seen = np.flatnonzero(np.isfinite(depth).any(axis=1))
    middle, unseen = len(depth) // 2, np.zeros(len(depth), dtype=bool)
    if len(seen) == 0:
        return depth, unseen
    right, left = middle - seen[0], seen[-1] - middle  # columns that are seen on either side
    if -CUT < ASIDE * min(right, left) < HALF <= ASIDE * max(right, left):
        aside = np.arange(len(depth)) - middle
        unseen = (aside if left < right else -aside) > max(min(right, left) - CUT / ASIDE, 0)
    return np.where(unseen[:, None], depth[::-1], depth), unseen


def mouth_arch(marks, middle: str, forward, aside):
    """Places (c, 3) mm ``aside`` (c,) mm to the left of the mark ``middle`` of a mouth, on an arch, since its corners lie
    farther back, and the unit vector (3,) upward across it.

    marks, forward : as in `mouth_outline`
    """
    across = marks["ch_l"] - marks["ch_r"]
    across = across - across @ forward * forward
    half = np.linalg.norm(across) / 2
    across /= 2 * half
    back = ((marks["ch_l"] + marks["ch_r"]) / 2 - marks[middle]) @ forward * (aside / half) ** 2
    return marks[middle] + aside[:, None] * across + back[:, None] * forward, np.cross(forward, across)


def middle_gap(depth):
    """Column, last place of the upper and first place of the lower lip, where a gap is seen in the middle; None: nowhere, or in
    few columns, as a hole in the scan would be. Of several columns the one that has the lower lip in the middle of where they
    have it: a hole below that lip makes the gap too wide in a few.

    depth (c, r) mm, see `looked_at`
    """
    found = []
    for column in len(depth) // 2 + (MIDDLE / ASIDE).astype(int):
        lips = widest_gap(depth[column, TOP:])
        if lips is not None:
            found.append((column, TOP + lips[0], TOP + lips[1]))
    if len(found) <= len(MIDDLE) / 2:
        return None
    lower = [start[2] for start in found]
    return found[int(np.argmin(np.abs(lower - np.percentile(lower, 50, method="lower"))))]


def large_gap(depth):
    """As `middle_gap`, of the largest gap anywhere above the chin: lips raised as far as in disgust may lead the search
    for the face a centimetre too far down."""
    found = []
    for column in len(depth) // 2 + (MIDDLE / ASIDE).astype(int):
        there = np.flatnonzero(np.isfinite(depth[column]))
        k = np.argmax(np.diff(there)) if len(there) > 1 else 0
        if len(there) > 1 and (there[k + 1] - there[k]) * DOWN > APART:
            found.append((column, there[k], there[k + 1]))
    return sorted(found, key=lambda gap: gap[1])[len(found) // 2] if len(found) > len(MIDDLE) / 2 else None


def lip_rolls(depth, gaps) -> tuple[float, float]:
    """mm by which the edges of the upper and the lower lip lie behind where those are foremost, beside ``gaps``: medians.

    depth (c, r) mm, see `looked_at`; gaps : `gaps_about` the middle
    """
    rolls = [
        (_roll(depth[c, : upper + 1], depth[c, upper:]), _roll(depth[c, : lower - 1 : -1], depth[c, lower::-1]))
        for c, upper, lower in gaps
    ]
    upper, lower = np.median(rolls, axis=0) if rolls else (0.0, 0.0)
    return float(upper), float(lower)


def scan_goes_on(target: Surface, places, depth, forward, gaps) -> bool:
    """Whether the scan does not end at the edges of either lip beside ``gaps``, but turns out of sight there.

    places (c, r, 3) mm and depth (c, r) mm on the scan, see `looked_at`; gaps : `gaps_about` the middle
    """
    if len(gaps) == 0:
        return False
    gaps = np.array(gaps)
    for lip in (1, 2):
        at = gaps[:, 0], gaps[:, lip]
        if target.closest(places[at] - depth[at][:, None] * forward, ENDS).border.mean() > ENDED:
            return False
    return True


def gaps_about(depth, column: int, top: int = TOP) -> list[tuple[int, int, int]]:
    """Columns near to a ``column`` in which there is a gap below the row ``top``, with the last place of the upper lip and the
    first of the lower.

    depth (c, r) mm, see `looked_at`
    """
    aside = int(ROLLED_OVER / ASIDE)
    found = []
    for c in range(max(column - aside, 0), min(column + aside + 1, len(depth))):
        lips = widest_gap(depth[c, top:])
        if lips is not None:
            found.append((c, top + lips[0], top + lips[1]))
    return found


def _roll(lip, inward) -> float:
    """How far an edge rolls in, mm: depths of a ``lip`` toward its edge, and from there ``inward``."""
    lip = lip[np.isfinite(lip)][-int(FOREMOST / DOWN) :]
    lip = np.convolve(lip, np.full(3, 1 / 3), "valid") if len(lip) > 2 else lip  # of single places noise would tell
    inward = inward[: int(INWARD / DOWN) + 1]
    ends = np.flatnonzero(~(np.diff(inward) < FOLLOWED))
    edge = inward[: ends[0] + 1] if len(ends) else inward
    return float(edge[-2:].mean() - lip.min())


def goes_on_below(depth) -> bool:
    """Whether what the scan lacks in the middle of the mouth goes on below what was looked at, ``depth`` (c, r) mm. A neck that
    is seen there, through the mouth or under the chin, is no lip."""
    return not (depth[len(depth) // 2 + (MIDDLE / ASIDE).astype(int), -1] < DEEP).any()


def widest_gap(line):
    """Last place of the upper and first place of the lower lip on a ``line`` (r,) of depths from one to below the other, mm;
    None: there is no gap.

    What lies before the way from lip to lip is a lip itself, and no tooth: above it is a crease then, and under it a hole.
    """
    there = np.flatnonzero(np.isfinite(line))
    ends = np.flatnonzero((np.diff(there) > 1 + SPECK / DOWN) | (np.abs(np.diff(line[there])) > STEP))
    for end in ends[::-1]:
        upper, lower = there[ends[0]], there[end + 1]
        before = way(line[upper], line[lower], lower - upper + 1) - line[upper : lower + 1] > BEHIND
        if (lower - upper) * DOWN > LEAST and not before.any():
            return upper, lower
    return None


def way(one: float, other: float, count: int) -> np.ndarray:
    """(count,) depths from ``one`` to the ``other`` lip, mm."""
    return np.linspace(one, other, count)


def gap_end(depth, column: int, upper: int, lower: int, step: int):
    """The last column, going by ``step``, that a gap reaches from ``column``, with the lips' edges there, as `middle_gap`."""
    drift, beside, speck = int(DRIFT / DOWN), int(BESIDE / DOWN), int(SPECK / DOWN)
    while 0 <= column + step < len(depth):
        line = depth[column + step]
        first, last = max(upper - drift, 0), min(lower + drift, len(line) - 1)
        over, under = line[max(first - beside, 0) : first + 1], line[last : last + beside + 1]
        over, under = over[np.isfinite(over)], under[np.isfinite(under)]
        if len(over) == 0 or len(under) == 0:
            break
        deep = ~(line[first : last + 1] <= way(over[-1], under[0], last + 1 - first) + BEHIND)  # so is where no data is
        gap = first + np.flatnonzero(deep)
        if len(gap) <= speck:
            break
        column, upper, lower = column + step, max(gap[0] - 1, 0), min(gap[-1] + 1, len(line) - 1)
    return column, upper, lower
