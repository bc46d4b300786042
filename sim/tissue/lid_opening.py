# SPDX-License-Identifier: GPL-3.0-or-later
"""How far lids open that were scanned shut: their margins as an open eye has them.

At rest the upper lid covers a little of the iris, the lower one touches its rim, and either margin is close to an arc
of the second degree from corner to corner, the upper one's crest a little nearer to the nose (Malbouisson, Baccega and
da Cruz 2000).
"""

import numpy as np

from .lid_closing import rise

#: mm of the iris that the open upper lid covers, on an eyeball of 12 mm.
COVERED = 2.2
#: Exponent of the place along the lid that moves the upper arc's crest toward the nose, and that of its fullness.
NASAL, FULL = 0.87, 1.1
#: Opening in the middle of the lids, mm on an eyeball of 12 mm, up to which they count as shut.
SHUT = 2.5


def missing_opening(along, corners, upper_margin, lower_margin, is_upper, eye, pupil: float) -> np.ndarray | None:
    """(v,) rad that each vertex has to turn for its lid to be open: up with the upper lid, down with the lower one; None
    for lids that are open.

    along (v,) mm, corners, margins : as in `lid_closing.lower_share`; is_upper (v,) bool
    eye : its iris tells where the margins belong; pupil : mm along the lid where it lies
    """
    (a0, e0), (a1, e1) = corners
    middle = a0 + np.linspace(0.25, 0.75, 9) * (a1 - a0)
    slit = rise(middle, upper_margin(middle), eye.radius) - rise(middle, lower_margin(middle), eye.radius)
    size = eye.radius / 12
    if np.median(slit) > SHUT * size:
        return None
    ends = rise(np.array([a0, a1]), np.array([e0, e1]), eye.radius)

    def arc(at, crest, nasal):
        shape, there = (
            (4 * s * (1 - s)) ** FULL for s in (np.clip((x - a0) / (a1 - a0), 0, 1) ** nasal for x in (at, pupil))
        )
        line, under = (np.interp(x, [a0, a1], ends) for x in (at, pupil))
        return line + shape * (crest - under) / max(float(there), 0.5)

    def turn(at, height, margin):
        away = rise(at, np.full(len(at), np.pi / 2), eye.radius)
        return np.arcsin(np.clip(height / away, -0.98, 0.98)) - margin(at)

    raised = turn(along, arc(along, eye.iris_radius - COVERED * size, NASAL), upper_margin)
    lowered = -turn(along, arc(along, -eye.iris_radius, 1.0), lower_margin)
    return np.clip(np.where(is_upper, raised, lowered), 0, None)
