# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the lids of a pose want to be: each vertex turned about the axis of its eye and kept over the ball."""

import numpy as np

from .eye_surface import eyeball_radius
from .structures import Lids

#: The middle of a lid lags behind its ends as it closes, so that its edge stays an arc: exponents over the share at the
#: corners of the eye and at its middle.
_LAG = (0.75, 1.4)
#: Share of a vertical gaze that the lids follow: (upper lid down, up; lower lid down, up).
_FOLLOW = (0.75, 0.6, 0.3, 0.12)
#: Share of a sideways gaze by which the middle of the lids is carried along: the cornea's bulge takes them with it, the
#: corners of the eye stay.
_ASIDE = 0.25
#: mm between skin and eyeball where the lid is taut.
_TAUT = 2.6
#: Share of an open eye's slit that a levator gives back to an eye that was scanned shut, per share by which it widens an
#: open one.
_WAKE = 3.125


def lid_targets(lids: Lids, upper: float, lower: float, gaze: np.ndarray) -> np.ndarray:
    """(v, 3) mm: where the lid vertices want to be. upper, lower: 0 rest, 1 closed, negative wider.

    The upper lid follows a vertical gaze (lid kinematics: 0.8 to 1 of it), the lower one a little. The cornea lifts the
    lid that it slides under, and the fold over the crease is drawn flat as the lid goes down.
    """
    down, rise = max(-float(gaze[1]), 0.0), max(float(gaze[1]), 0.0)
    woken = np.clip(-_WAKE * upper, 0, None) * (1 - lids.awake)
    awake = np.clip(lids.awake + woken, 0, 1)
    shut = np.clip(upper, 0, 1)
    along = awake * (1 - 0.6 * shut) * (_FOLLOW[3] * rise - _FOLLOW[2] * down)
    follow = awake * (1 - shut) * (_FOLLOW[1] * rise - _FOLLOW[0] * down) + shut * along
    turn_upper = -_lagging(lids, upper) * (1 - lids.lower_share) * lids.opening + lids.middle * follow
    turn_lower = _lagging(lids, lower) * lids.lower_share * lids.opening + lids.middle * along
    turn_upper, turn_lower = turn_upper + woken * lids.missing, turn_lower - woken * lids.missing
    # never past each other: the meeting line limits both, whichever way the eye looks
    closed = turn_lower - turn_upper
    over = np.where(closed > lids.opening, lids.opening / np.maximum(closed, 1e-9), 1.0)
    share = np.clip(closed * over / np.maximum(lids.opening, 1e-9), 0, 1)
    press = lids.seal * share**4 * (lids.opening > 0)
    turn = np.where(lids.upper, turn_upper * over - press, turn_lower * over + press)
    angle = lids.elevation + lids.weight * turn

    gap = lids.gap
    # skin that hung in the fold is drawn flat over the ball
    drawn = np.clip(-turn / np.maximum(0.8 * lids.opening, 0.1), 0, 1) * (lids.upper & ~lids.inner)
    drawn = drawn * np.clip(4 * lids.weight * (1 - lids.weight), 0, 1)
    height = gap - drawn * np.maximum(gap - _TAUT - 6 * (1 - lids.weight) ** 3, 0)
    plane = np.cos(angle)[:, None] * lids.forward + np.sin(angle)[:, None] * lids.up
    # to the subject's left is along the lid, out or in
    aside = _ASIDE * lids.eye.radius * np.sin(float(gaze[0])) * np.sign(lids.axis[0]) * lids.middle * lids.weight
    target = (lids.along + aside)[:, None] * lids.axis + lids.radius[:, None] * plane
    size = np.linalg.norm(target, axis=1)
    # near the ball, heights are over what lies below now
    under = eyeball_radius(lids, lids.eye.centre + target, gaze)
    close = np.where(lids.inner, 1.0, lids.weight) * np.clip((5.0 - gap) / 2.5, 0, 1)
    # a lining that is drawn out between margin and fornix stands off, or it would cut the corner
    out = np.where(lids.upper, -turn, turn)
    out = np.clip(out, 0, None) if not lids.awake else np.abs(turn)
    height = height + lids.inner * out * (0.4 + 2.5 * (1 - lids.weight)) * (lids.weight < 0.99)
    want = size + close * (under + height - size) + (1 - close) * (height - gap)
    want = np.maximum(want, under + np.minimum(gap, 0.15))
    return lids.eye.centre + target * (want / np.maximum(size, 1e-9))[:, None] + (share**2)[:, None] * lids.relief


def _lagging(lids: Lids, amount: float):
    """(v,) how far each part of a lid is when its blink is at ``amount``."""
    if not 0 < amount < 1:
        return amount
    return amount ** (_LAG[0] + (_LAG[1] - _LAG[0]) * lids.middle**2)
