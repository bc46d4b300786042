# SPDX-License-Identifier: GPL-3.0-or-later
"""One eye shut and the other open: eyes are taken for alike unless what they lack and their creases both tell them apart."""

from ..adapt.lid_line import PLAIN, LidLine
from .eye_gaps import EyeGaps

#: By so much more of its lines the open eye gapes, and by so much its second crease is deeper against its first. The lesser of
#: the two differences is .38 to 1.0 of seven winks, and up to .19 of 50 scans of eyes that are alike.
DIFFERENT = 0.3


def winking(gaps: dict[str, EyeGaps], lines: dict[str, LidLine]) -> str | None:
    """The side of the one eye that is shut while the other is open; None: they are alike, or no crease is seen plainly.

    gaps, lines : side -> `EyeGaps` and `LidLine` of both eyes
    """
    shut, other = sorted(gaps, key=lambda side: gaps[side].gaping)
    if min(line.depth for line in lines.values()) < PLAIN:
        return None
    gapes = gaps[other].gaping - gaps[shut].gaping
    creased = lines[other].second / lines[other].depth - lines[shut].second / lines[shut].depth
    return shut if min(gapes, creased) > DIFFERENT else None
