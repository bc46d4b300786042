# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the scan's lips are parted and its eyes shut."""

import numpy as np
from scipy.spatial import cKDTree

from ..adapt.closest import Surface
from .shape_fit import CHANGE, Expression, ShapeFit, fit_shape
from .shape_space import ShapeSpace

AROUND_EYE = 22.0  # mm
FAR = 3.0  # mm that a point of the skin without data counts as
REASON = 0.95  # shut eyes must fit that much better
MIDDLE = 0.6  # share of the mouth's width in which lips are looked between
GAP, BEHIND = 2.5, 3.5  # mm: lips so far apart, and nothing but what lies so far behind them, are parted
DEEP = 16.0  # mm


def fit_expression(space: ShapeSpace, target: Surface, fit: ShapeFit):
    """A generator: yields the fraction done, returns the `ShapeFit` and the `Expression` that the scan shows."""
    moved = fit.coefficients + space.parted
    free = yield from _half(fit_shape(space, target, fit.pose, CHANGE, moved, 1, Expression(True)), 0.0)
    parted = lips_parted(space, free, target)
    fit = free if parted else fit
    shut = Expression(parted, ("l", "r"))
    moved = fit.coefficients + space.shut["l"] + space.shut["r"]
    rival = yield from _half(fit_shape(space, target, fit.pose, CHANGE, moved, 1, shut), 0.5)
    about = eyes(space)
    if cost(space, rival, about) < REASON * cost(space, fit, about):
        return rival, shut
    return fit, Expression(parted)


def _half(work, start):
    while True:
        try:
            done = next(work)
        except StopIteration as end:
            return end.value
        yield start + 0.5 * done


def lips_parted(space: ShapeSpace, free: ShapeFit, target: Surface) -> bool:
    """Whether the scan shows an open mouth, told by a fit whose lips were ``free`` to part.

    Where closed lips were taken for parted ones, the scan's surface still passes between them.
    """
    marks = space.landmarks(space.points)
    width = MIDDLE * (marks["ch_l"] - marks["ch_r"])[0] / 2
    upper, lower = (index[np.abs(space.points[space.lips[0], 0]) < width] for index in space.lips)
    size, front = free.pose.scale, -free.pose.turn[:, 1]
    middle = (free.points[upper] + free.points[lower]) / 2
    gap = np.linalg.norm(free.points[upper] - free.points[lower], axis=1) / size
    line, along, _, _ = target.crossings(middle, np.broadcast_to(front, middle.shape), DEEP * size)
    foremost = np.full(len(middle), -DEEP)
    np.maximum.at(foremost, line, along / size)
    return bool(np.median(gap) > GAP and np.median(foremost) < -BEHIND)


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


def eyes(space: ShapeSpace) -> np.ndarray:
    """(n,) bool, the skin around the eyes."""
    marks = space.landmarks(space.points)
    middles = [(marks[f"en_{side}"] + marks[f"ex_{side}"]) / 2 for side in "lr"]
    return cKDTree(middles).query(space.points)[0] < AROUND_EYE


def cost(space: ShapeSpace, fit: ShapeFit, about) -> float:
    """Mean distance to the scan over the skin ``about`` (n,) bool, mm."""
    distance = np.minimum(np.abs(np.nan_to_num(fit.distance[about], nan=FAR)), FAR)
    return float(np.average(distance, weights=space.area[about]))
