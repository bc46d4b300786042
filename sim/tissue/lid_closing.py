# SPDX-License-Identifier: GPL-3.0-or-later
"""How lids lie when they are shut: the line on which they meet, and the skin that hung in the fold, spread over the ball.

Closed lids meet on one arc from corner to corner, most of the way down (Evinger et al. 1991: the upper lid does nearly
all of a blink). The edges lie flush, and above them the skin of crease and fold is drawn out evenly.
"""

import numpy as np

from ..angles import bearing
from .structures import Lids

#: Share of the opening that the lower lid covers in a blink at the middle of the eye, at least and at most beside it.
LOWER_SHARE, SHARES = 0.12, (0.1, 0.6)
#: mm over the ball of the seen lid when shut, at least, from a quarter of its length on: its back needs room.
PLATE = 2.3
#: Rounds in which the reliefs of neighbouring strips are evened out.
EVEN = 2


def rise(along, elevation, radius: float) -> np.ndarray:
    """(k,) mm up, over the plane of both corners of the eye and the centre, of points of a ball (mm along the lid, rad)."""
    return np.sqrt(np.maximum(radius**2 - along**2, (0.3 * radius) ** 2)) * np.sin(elevation)


def lower_share(along, corners, upper, lower, radius: float) -> np.ndarray:
    """(v,) share of the opening that the lower lid covers, so that the lids meet on an arc through both corners.

    along (v,) mm; corners (2, 2): along and elevation of both; upper, lower : elevation of the margins (v,) rad as
    functions of ``along``; radius : mm of the eyeball
    """
    (a0, e0), (a1, e1) = corners
    middle = np.array([(a0 + a1) / 2])

    def meet(at):
        low = rise(at, lower(at), radius)
        return low + LOWER_SHARE * (rise(at, upper(at), radius) - low)

    ends = rise(np.array([a0, a1]), np.array([e0, e1]), radius)
    t = (along - a0) / (a1 - a0)
    arc = ends[0] + t * (ends[1] - ends[0]) + 4 * t * (1 - t) * (meet(middle) - ends.mean())
    low, high = rise(along, lower(along), radius), rise(along, upper(along), radius)
    return np.clip((arc - low) / np.maximum(high - low, 0.5), *SHARES)


def relief(lids: Lids, shut: np.ndarray, root, length, pair, reach) -> np.ndarray:
    """(v, 3) mm to add to where plain turning puts the seen skin of shut lids.

    shut : (v, 3) mm, the lids as plain turning shuts them
    root, length : strip across the lid of each vertex, and mm along it from the margin (`lid_edges.strips`)
    pair : (e, 2) edges between lid vertices
    reach : callable, points (k, 3) mm -> mm from the eye's centre to the ball's surface there
    """
    out = np.zeros_like(shut)
    seen = (root >= 0) & ~lids.inner & (length > 0)
    strip = root[seen]
    if not len(strip):
        return out
    count = root.max() + 1
    rows = np.flatnonzero(seen)
    order = np.lexsort((length[rows], strip))
    rows, strip = rows[order], strip[order]
    first = rows[np.searchsorted(strip, np.arange(count)).clip(max=len(rows) - 1)]
    last = rows[(np.searchsorted(strip, np.arange(count), side="right") - 1).clip(min=0)]
    start = np.zeros(count, dtype=int)
    margin = np.flatnonzero((length == 0) & (root >= 0))
    start[root[margin]] = margin
    frame = np.stack([lids.axis, lids.forward, lids.up])
    local = (shut - lids.eye.centre) @ frame.T
    # the outer edge straight before the inner one
    edge, rim = local[start], local[first]
    angle = bearing(edge[:, 2], edge[:, 1])
    turned = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    thick = length[first]
    flush = np.hypot(edge[:, 1], edge[:, 2])[:, None] * turned + thick[:, None] * turned
    flush = np.stack([rim[:, 0], *flush.T], axis=1)
    # from there evenly along a smooth path to where the lid ends
    end = local[last]
    apart = end[:, 1:] - flush[:, 1:]
    size = np.linalg.norm(apart, axis=1, keepdims=True)
    sign = np.where(lids.upper[start], 1.0, -1.0)[:, None]
    leave = sign * np.stack([-turned[:, 1], turned[:, 0]], axis=1) * size
    t = (length[rows] - thick[strip]) / np.maximum(length[last] - thick, 1e-6)[strip]
    t = np.clip(t, 0, 1)[:, None]
    path = (
        (2 * t**3 - 3 * t**2 + 1) * flush[strip, 1:]
        + (t**3 - 2 * t**2 + t) * leave[strip]
        + (3 * t**2 - 2 * t**3) * end[strip, 1:]
        + (t**3 - t**2) * apart[strip]
    )
    goal = np.concatenate([local[rows, :1], path], axis=1)
    world = lids.eye.centre + goal @ frame
    away = world - lids.eye.centre
    far = np.linalg.norm(away, axis=1)
    least = reach(world) + thick[strip] + np.clip(4 * t[:, 0], 0, 1) * np.maximum(PLATE - thick[strip], 0)
    world = lids.eye.centre + away * (np.maximum(far, least) / far)[:, None]
    # the lower lid only closes ranks at its edge
    share = np.where(lids.upper[rows], 1.0, (t[:, 0] == 0).astype(float))
    out[rows] = (share * np.clip(1.3 * lids.middle[rows], 0, 1))[:, None] * (world - shut[rows])
    # evenly from strip to strip
    beside = pair[seen[pair].all(axis=1) & (root[pair[:, 0]] != root[pair[:, 1]])]
    count = np.maximum(np.bincount(beside.ravel(), minlength=len(out)), 1)[:, None]
    for _ in range(EVEN):
        total = np.zeros_like(out)
        np.add.at(total, beside[:, 0], out[beside[:, 1]])
        np.add.at(total, beside[:, 1], out[beside[:, 0]])
        out += seen[:, None] * 0.5 * (total / count - out)
    return out
