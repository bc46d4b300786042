# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the scan's lips are parted and its eyes shut."""

import numpy as np

from ..adapt.closest import Surface
from ..adapt.lid_line import PLAIN, LidLine
from ..mesh import Mesh
from ..relax.mouth_gap import lip_edges
from ..relax.upper_teeth import incisal_edge
from .blank_eyes import blank_eyes
from .eye_colours import open_by_colours
from .eye_gaps import EyeGaps, eyes_shown, gaps_in_eyes
from .eye_sockets import socket_corners
from .eyeballs_seen import eyeballs_seen
from .lid_creases import lid_lines, shut_by_creases, told_of_lids
from .lip_line import LipLine, lip_line
from .mouth_outline import MouthOutline, mouth_outline
from .open_lids import of_both_eyes, open_lids, told_of_open_lids
from .picked import moved
from .shape_fit import CHANGE, REST, Expression, ShapeFit, Told, fit_shape, part_of
from .shape_space import ShapeSpace
from .winks import winking

FAR = 3.0  # mm that a point of the skin without data counts as
AROUND_MOUTH = 35.0  # mm
LOOKED = np.linspace(-0.28, 0.28, 9)  # shares of the way from the middle of the mouth to its corners
#: Eyes that are open, as their gaps tell, and shut farther than this were misread: the gaps take the lids' edges with them,
#: and nothing else holds the lids up.
DROOPED = 0.15
#: Eyes that fit so much wider open than the reference's are not seen to be shut, for the fit is off there, unless there is no
#: second crease at all: no more than that much of the first.
WIDE, ALONE = -0.2, 0.1
#: mm on a head of the reference's size between the edges of lips that are parted: noise parts closed lips by 2.9, a tube
#: between them by 6, a smile with teeth by 12.
APART = 4.0
FAR_APART = 12.0  # mm: what is ajar is less
#: How far from the scan lips that are parted may lie, against closed ones: two fits differ as much by chance. Where a gap is
#: seen they are parted, whatever fits, if it is no hole, or the edge of the upper teeth is seen in it: parted lips fitted
#: .54 to 1.06 of closed ones on 32 scans of open mouths, and .79 to 1.34 on 12 of closed ones with a hole there. Without either
#: they are parted only if they fit better than around any hole.
NO_WORSE, BETTER = 1.05, 0.75
FEW = 25  # percent of them at which lips that are parted may seem closed: noise looks like edges in places only


def fit_expression(space: ShapeSpace, target: Surface, fit: ShapeFit, scan: Mesh | None = None):
    """A generator: yields the fraction done, returns the `ShapeFit` and the `Expression` that the scan shows.

    scan : its vertices, mm, and their colours, if it has any
    """
    fit, parted, told = yield from _fit_lips(space, target, fit)
    return (yield from _fit_lids(space, target, fit, parted, told, scan))


def _fit_lips(space, target, fit):
    """As `fit_expression`; returns the `ShapeFit`, whether its lips are parted, and what is `Told` of them."""
    opened = fit.coefficients + space.parted
    free = yield from part_of(fit_shape(space, target, fit.pose, CHANGE, opened, 1, Expression(True)), 0, 3)
    outline = outline_of(space, free, target)
    told = None if outline is None else told_of_mouth(space, outline)
    if told is not None:
        work = fit_shape(space, target, free.pose, CHANGE, free.coefficients, 1, Expression(True), told)
        free = yield from part_of(work, 1, 3)
    parted = told is not None and (outline.no_hole or teeth_seen(space, free, target))
    if not parted and (told is not None or lips_ajar(space, free, target)):
        mouth, least = about_mouth(space), NO_WORSE if told is None else BETTER
        parted = cost(space, free, mouth) < least * cost(space, fit, mouth)
    if parted:
        return free, True, told
    line = line_of(space, fit, target)
    if line is None:
        return fit, False, None
    told = told_of_lips(space, fit, line)
    fit = yield from part_of(fit_shape(space, target, fit.pose, CHANGE, fit.coefficients, 1, REST, told), 1, 3)
    return fit, False, told


def _fit_lids(space, target, fit, parted, told, scan):
    """As `fit_expression`, of a ``fit`` whose lips are ``parted`` and of which that is ``told`` already."""

    def changed(expression, start, more=None):
        every = more if told is None else told.and_of(more)
        return part_of(fit_shape(space, target, fit.pose, CHANGE, start, 1, expression, every), 2, 3)

    marks = space.landmarks(fit.points)
    corners = socket_corners(marks, fit.matrix, target)
    laid = marks | corners, fit.matrix, target
    sides = eyes_shown(*laid)  # an eye that is not seen is as the other
    eyeballs = eyeballs_seen(*laid)
    lines = lid_lines(space, fit, target, sides)
    wink = winking({side: gaps_in_eyes(*laid, side) for side in sides}, lines) if len(sides) == 2 else None
    if wink is not None:
        seen = open_lids(*laid, eyeballs, sides.replace(wink, ""))
        one = Expression(parted, (wink,), lids=seen)
        lids = told_of_open_lids(space, fit, seen).and_of(told_of_lids(space, fit, {wink: lines[wink]}))
        return (yield from changed(one, fit.coefficients + _shutting(space, fit, one.shut), lids)), one
    gaps = gaps_in_eyes(*laid, sides)
    known_open = gaps.show_open or bool(eyeballs) or bool(corners)
    if known_open:
        seen = corners | open_lids(*laid, eyeballs, sides)
    else:  # a slit along lids that meet may look like the outline of blank eyes
        seen = {} if gaps.show_shut else blank_eyes(*laid, sides)
    if seen:
        lids = told_of_open_lids(space, fit, of_both_eyes(seen, marks))
        return (yield from changed(Expression(parted), fit.coefficients, lids)), Expression(parted, lids=seen)
    share = shut_share(space, fit)
    seen_share = {side: share[side] for side in sides}
    by_colours = None if known_open else open_by_colours(scan, *laid[:2], sides)
    shut = shut_by_sight(gaps, lines, seen_share) if by_colours is None else not by_colours
    if known_open or not shut:
        seen_open = known_open or shut is False
        if seen_open and max(seen_share.values()) <= DROOPED:
            return fit, Expression(parted)
        wide = Expression(parted, wide=True)
        return (yield from changed(wide, fit.coefficients)), wide
    both = Expression(parted, ("l", "r"))
    shutting = fit.coefficients + _shutting(space, fit, both.shut)
    return (yield from changed(both, shutting, told_of_lids(space, fit, lines))), both


def _shutting(space, fit, sides):
    """What more (m,) shuts the eyes on these ``sides`` of a ``fit``."""
    share = shut_share(space, fit)
    return sum((1 - share[side]) * space.shut[side] for side in sides)


def shut_by_sight(gaps: EyeGaps, lines: dict[str, LidLine], share: dict[str, float]) -> bool | None:
    """Whether the eyes are seen to be shut: by what the scan lacks there, its ``gaps``, or by the creases ``lines`` along
    them; None: that is not seen.

    lines : side -> `LidLine`; share : side -> how far a fit has that eye shut
    """
    if gaps.show_open or gaps.show_shut:
        return gaps.show_shut
    shut = shut_by_creases(lines)
    alone = max(line.second / max(line.depth, PLAIN) for line in lines.values()) < ALONE
    return None if shut and not alone and np.mean(list(share.values())) < WIDE else shut


def shut_share(space: ShapeSpace, fit: ShapeFit) -> dict[str, float]:
    """Side -> how far that eye is shut in a fit that took it for open: 0 as the reference's, 1 shut."""
    return {side: float(fit.coefficients @ shut / (shut @ shut)) for side, shut in space.shut.items()}


def outline_of(space: ShapeSpace, fit: ShapeFit, target: Surface) -> MouthOutline | None:
    """`mouth_outline` of the scan, looked for where the lips of ``fit`` are."""
    return mouth_outline(target, space.landmarks(fit.points), -fit.pose.turn[:, 1], fit.pose.scale)


def line_of(space: ShapeSpace, fit: ShapeFit, target: Surface) -> LipLine | None:
    """`lip_line` of the scan, looked for where the lips of ``fit`` are."""
    return lip_line(target, space.landmarks(fit.points), -fit.pose.turn[:, 1], fit.pose.scale)


def told_of_lips(space: ShapeSpace, fit: ShapeFit, line: LipLine) -> Told:
    """What the ``line`` of closed lips tells of the skin laid on the scan by ``fit``: where its corners and its middle are."""
    return Told.of(space, {name: place - fit.matrix @ moved(name) for name, place in line.marks.items()})


def told_of_mouth(space: ShapeSpace, outline: MouthOutline) -> Told:
    """What the ``outline`` of a parted mouth tells of the skin: where its corners and the middle of its lips are."""
    middle = np.abs(space.points[space.lips[0], 0]).argmin()
    edges = np.array([lip[middle] for lip in space.lips])
    corners, weights = np.repeat(edges[:, None], 3, axis=1), np.tile([1.0, 0.0, 0.0], (2, 1))
    lips = Told(corners, weights, np.array([outline.upper, outline.lower]))
    return Told.of(space, outline.corners).and_of(lips)


def lips_ajar(space: ShapeSpace, free: ShapeFit, target: Surface) -> bool:
    """Whether the lips are a little apart: between those of a fit that was ``free`` to part them the scan has two edges.

    Where closed lips were taken for parted ones, the scan's surface runs from one to the other without a step, but for
    noise here and there. Of lips far apart the `mouth_outline` tells; edges as far from each other without one are the
    crease between closed lips and a hole under the lower one.
    """
    forward = -free.pose.turn[:, 1]
    edges = lip_edges(target, space.landmarks(free.points), forward, LOOKED)
    apart = np.nan_to_num(np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1))
    return bool(np.percentile(apart, FEW) > APART * free.pose.scale and np.median(apart) < FAR_APART * free.pose.scale)


def teeth_seen(space: ShapeSpace, free: ShapeFit, target: Surface) -> bool:
    """Whether the edge of the upper teeth is seen between the lips of a fit that was ``free`` to part them."""
    return len(incisal_edge(target, space.landmarks(free.points), -free.pose.turn[:, 1])) > 0


def meeting_lids(space: ShapeSpace, fit: ShapeFit, target: Surface, shut) -> dict[str, np.ndarray]:
    """Name -> (3,) mm: ``ps`` and ``pi`` of the eyes that are ``shut``, in one place where their lids meet."""
    marks = space.landmarks(fit.points)
    out = {}
    for side in shut:
        middle = (marks[f"ps_{side}"] + marks[f"pi_{side}"]) / 2
        found = target.closest(middle[None], FAR * fit.pose.scale)
        place = found.points[0] if found.found[0] else middle
        out |= {f"ps_{side}": place, f"pi_{side}": place}
    return out


def about_mouth(space: ShapeSpace) -> np.ndarray:
    """(n,) bool, the skin around the mouth."""
    return np.linalg.norm(space.points - space.landmarks(space.points)["sto"], axis=1) < AROUND_MOUTH


def cost(space: ShapeSpace, fit: ShapeFit, about) -> float:
    """Mean distance to the scan over the skin ``about`` (n,) bool, mm."""
    distance = np.minimum(np.abs(np.nan_to_num(fit.distance[about], nan=FAR)), FAR)
    return float(np.average(distance, weights=space.area[about]))
