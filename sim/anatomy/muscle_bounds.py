# SPDX-License-Identifier: GPL-3.0-or-later
"""Bellies kept in their room smoothly: no vertex moves alone (Kähler 2002, 5.2, item 3).

A belly is two heights over the sheet of its fibres, one for its upper and one for its lower side. Room bounds both. The
bounds are narrowed to the least of the neighbourhood and then averaged over no more than that neighbourhood, so they are
smooth and nowhere beyond the room itself; where it is too narrow a belly gets thin instead of ragged.
"""

from dataclasses import dataclass

import numpy as np

from ..progress import Progress, Work, finish, portion
from .muscle_room import FAR, Room

#: mm of belly that is left where there is no room at all.
THIN = 0.1
#: Neighbours in the grid over which bounds are narrowed and averaged.
REACH = 2
#: Power of the softened minimum; mm a belly may be moved.
SOFT, SHIFT = 6.0, 4.0
#: mm from a wall within which it is asked for at all where bellies give way.
NEAR = 1.5


@dataclass(eq=False)
class Belly:
    """top, low, normal : (c, s, 3), its two sides over the places of a sheet and the unit way from low to top.

    The outermost columns of both sides are the same edge. free : (s,) 0..1, how far a station may leave its place to
    clear deeper muscles; ring : the last station is followed by the first.
    """

    top: np.ndarray
    low: np.ndarray
    normal: np.ndarray
    ring: bool = False
    free: np.ndarray | None = None

    @property
    def middle(self) -> np.ndarray:
        """(c, s, 3) mm midway between both sides."""
        return (self.top + self.low) / 2


def bounded(bellies: list[Belly], room: Room, rounds: int = 4, floor=None, cover=0.0, strict=True) -> list[Belly]:
    """`bounding`, at once."""
    return finish(bounding(bellies, room, rounds, floor, cover, strict))


def bounding(bellies: list[Belly], room: Room, rounds: int = 4, floor=None, cover=0.0, strict=True) -> Work:
    """Work returning ``bellies`` moved and thinned along their normals until they lie in ``room``.

    floor : callable(points (n, 3), ways (n, 3)) -> (n,) mm by which points must rise to clear what lies deeper
    (negative: they need not), or None; cover : mm left free over the upper side; strict : nothing may stay
    in a wall, even where it stands beside the normals
    """
    shapes = [b.top.shape[:2] for b in bellies]
    cuts = np.cumsum([c * s for c, s in shapes])[:-1]

    def split(values):
        """Per belly (c, s) of what is known for all places of all bellies."""
        return [part.reshape(shape) for part, shape in zip(np.split(values, cuts), shapes, strict=True)]

    ways = np.concatenate([b.normal.reshape(-1, 3) for b in bellies])
    start = [
        np.concatenate([x.reshape(-1, 3) for x in side])
        for side in ([b.top for b in bellies], [b.low for b in bellies])
    ]
    thick = np.einsum("nj,nj->n", start[0] - start[1], ways)
    # heights of both sides over the middle of the belly as it came
    top, low = thick / 2, -thick / 2
    for turn in range(rounds):
        yield Progress(0.5 * turn / rounds, "Muscles")
        points = [start[0] + (top - thick / 2)[:, None] * ways, start[1] + (low + thick / 2)[:, None] * ways]
        least, most = room.span(np.concatenate(points), np.concatenate([ways, ways]))
        n = len(ways)
        under, over = np.maximum(low + least[n:], top + least[:n]), np.minimum(top + most[:n], low + most[n:])
        ground = np.full(n, -FAR)
        if floor is not None:
            ground = low + np.clip(floor(points[1], ways), -FAR, FAR)
        fields = [split(x) for x in (thick, under, over, ground)]
        news = [_placed(*x, cover) for x in zip(*fields, bellies, strict=True)]
        top, low = (np.concatenate([x[k].ravel() for x in news]) for k in (0, 1))
    moved = (start[0] + (top - thick / 2)[:, None] * ways, start[1] + (low + thick / 2)[:, None] * ways)
    sides = [[p.reshape(*shape, 3) for p, shape in zip(np.split(m, cuts), shapes, strict=True)] for m in moved]
    if not strict:
        return [Belly(t, w, b.normal, b.ring, b.free) for t, w, b in zip(*sides, bellies, strict=True)]
    # what is left in a wall stands beside it or has no room at all: it gives way with its neighbours
    both = [side for pair in zip(*sides, strict=True) for side in pair]
    rings = [b.ring for b in bellies for _ in (0, 1)]
    both = yield from portion(easing(both, None, None, rings, room, rounds=6, wide=2), 0.5, 1.0)
    return [Belly(t, w, b.normal, b.ring, b.free) for t, w, b in zip(both[::2], both[1::2], bellies, strict=True)]


def _all_free(belly):
    return np.ones(belly.top.shape[1]) if belly.free is None else belly.free


def _placed(thick, under, over, ground, belly, cover):
    """Heights (c, s) of both sides, as near to -thick/2 and thick/2 as smoothed bounds let them.

    Walls (``under``, ``over``) come before what lies deeper (``ground``) and what shall lie over it (``cover`` mm). The
    upper side rises above the ground even where the lower one need not, so that what is deeper does not show.
    """
    ring, half = belly.ring, np.clip((over - under) / 2, 0, thick / 2)
    # seen from a line that follows the room, neighbours narrow it less
    line = np.where(over > under, np.clip(0.0, under + half, over - half), (under + over) / 2)
    line = smoothed(line, ring)
    over = line + smoothed(narrowed(over - line, ring), ring)
    under = line - smoothed(narrowed(line - under, ring), ring)
    ground = -smoothed(narrowed(-ground, belly.ring, 1), belly.ring, 1)
    ceiling = over - np.clip(0.4 * (over - under), 0, cover)
    free = _all_free(belly)
    floor = np.maximum(under, np.minimum(free * ground - (1 - free) * FAR, ceiling - 2 * THIN))
    left = ceiling - floor
    peak = np.maximum(thick.max(axis=0, keepdims=True), 1e-9)
    # the softened lesser of both, rounded across as the belly is
    room = np.maximum(left, THIN)
    now = thick / peak * (peak**-SOFT + room**-SOFT) ** (-1 / SOFT)
    middle = np.where(left > now, np.clip(0.0, floor + now / 2, ceiling - now / 2), (floor + ceiling) / 2)
    middle = np.clip(middle, -SHIFT, SHIFT)
    top = np.maximum(middle + now / 2, np.minimum(ground + THIN, ceiling))
    top[[0, -1]] = (middle + now / 2)[[0, -1]]
    return top, middle - now / 2


def narrowed(values, ring, reach=REACH):
    """The least of each value (c, s) and its neighbours."""
    for _ in range(reach):
        for axis in (0, 1):
            before, after = beside(values, axis, ring and axis == 1)
            values = np.minimum(np.minimum(before, values), after)
    return values


def smoothed(values, ring, rounds=REACH):
    """Values (c, s, ...) averaged with their neighbours, both ways, ``rounds`` times."""
    for _ in range(rounds):
        for axis in (0, 1):
            before, after = beside(values, axis, ring and axis == 1)
            values = 0.25 * (before + after) + 0.5 * values
    return values


def beside(values, axis: int, closed: bool):
    """The neighbours of values (c, s, ...) before and after them along ``axis``; the ends are their own if not closed."""
    index = np.arange(values.shape[axis])
    if closed:
        before, after = np.roll(index, 1), np.roll(index, -1)
    else:
        before, after = np.maximum(index - 1, 0), np.minimum(index + 1, len(index) - 1)
    return values.take(before, axis), values.take(after, axis)


def sheet_normals(sheet, ring):
    """(c, s, 3) unit normals of a sheet of fibres (c, s, 3), evened along and across it."""
    along = np.roll(sheet, -1, 1) - np.roll(sheet, 1, 1) if ring else np.gradient(sheet, axis=1)
    side = np.gradient(sheet, axis=0)
    # Where fibres meet in one point the sheet has no breadth: the middle of the station says how it lies.
    normal = np.cross(along, side) + 0.2 * np.cross(along, side.mean(axis=0)[None])
    for _ in range(4):
        normal = smoothed(normal / np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-9), ring, 1)
    return normal / np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-9)


def eased(fibres: list[np.ndarray], keep, clear, rings, room: Room, rounds: int = 12, beside=1.0, wide: int = 1):
    """`easing`, at once."""
    return finish(easing(fibres, keep, clear, rings, room, rounds, beside, wide))


def easing(
    fibres: list[np.ndarray], keep, clear, rings, room: Room, rounds: int = 12, beside=1.0, wide: int = 1
) -> Work:
    """Work returning fibres, each (f, p, 3) mm, bent out of the walls of ``room`` by smooth displacements.

    keep : each (f, p) 0..1, how free a point is (None: wholly); clear : each (f, p) mm to keep from every wall (None:
    0); beside : share of a displacement that may slide the fibres along their own sheet; wide : neighbours that go along
    """
    shapes = [f.shape for f in fibres]
    cuts = np.cumsum([a * b for a, b, _ in shapes])[:-1]
    at = np.concatenate([f.reshape(-1, 3) for f in fibres])
    free, wanted = (
        np.full(len(at), default) if each is None else np.concatenate([x.ravel() for x in each])
        for each, default in ((keep, 1.0), (clear, 0.0))
    )
    normal = np.concatenate([sheet_normals(f, ring).reshape(-1, 3) for f, ring in zip(fibres, rings, strict=True)])
    reach = float(wanted.max(initial=0.0)) + 2 * NEAR
    slack = np.zeros(len(at))
    for turn in range(rounds):
        yield Progress(turn / rounds, "Muscles")
        push = np.zeros_like(at)
        ask = np.flatnonzero(slack < 0.1)  # the others were farther from walls than they have moved since
        slack[ask] = reach - NEAR
        for distance, away in room.walls(at[ask], reach):
            yield Progress((turn + 0.5) / rounds, "Muscles")
            lack = wanted[ask] - distance
            slack[ask] = np.minimum(slack[ask], -lack)
            push[ask] += np.clip(lack, 0, 2.0)[:, None] * away
        if np.abs(push).max(initial=0) < 0.01:
            break
        across = np.einsum("nj,nj->n", push, normal)[:, None] * normal
        push = across + beside * (push - across)
        parts = [x.reshape(shape) for x, shape in zip(np.split(push, cuts), shapes, strict=True)]
        parts = [smoothed(x, ring, wide) for x, ring in zip(parts, rings, strict=True)]
        step = 1.3 * free[:, None] * np.concatenate([x.reshape(-1, 3) for x in parts])
        at = at + step
        slack -= np.linalg.norm(step, axis=1)
    return [x.reshape(shape) for x, shape in zip(np.split(at, cuts), shapes, strict=True)]
