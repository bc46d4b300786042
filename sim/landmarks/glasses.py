# SPDX-License-Identifier: GPL-3.0-or-later
"""Glasses, their lenses too where a scanner sees those and not through them: they stand off the face before both eyes.

Lenses take up so much of a face that a plausible head laid on the scan (`shape_fit`) is drawn toward them. Once it is seen
that there are glasses, it is laid on what lies farther from them, and tells what of the rest is skin.
"""

import numpy as np
from scipy.spatial import cKDTree

from ..adapt.closest import Surface
from .shape_fit import CHANGE, ShapeFit, fit_shape, part_of
from .shape_space import ShapeSpace
from .things import REACH, pieces, standing_off, things

#: mm, all on a head of the reference's size. Frames and lenses on faces of four people stand off by 14 and more, over 180 mm²
#: of more than 5 at each eye; the same faces and 14 others without any by at most 8, over 84 (eyelashes made of triangles).
BESIDE, ACROSS, BEFORE, BEHIND = 38.0, 32.0, 45.0, 25.0  # from the middle of an eye that is looked at
PLAINLY, HIGH = 5.0, 10.0  # that they stand off plainly; somewhere at each eye
LEAST = 120.0  # mm² of each eye's that do so
ANY = 60.0  # mm² of a piece of them
SIDES = 12.0  # before the ears' canals, at which their sides are given up
BEFORE_SKIN = 20.0  # to which they hide skin behind them
BLIND = 12.0  # about them, what is not heeded to tell which skin is theirs


def fit_without_glasses(space: ShapeSpace, target: Surface, fit: ShapeFit):
    """A generator: yields the fraction done, returns a `ShapeFit` to the scan ``target`` without glasses, and one that tells
    what those are (`glasses_seen`); ``fit`` and None where there are none."""
    seen = before_eyes(space, fit, target)
    if not seen.any():
        return fit, None
    apart = cKDTree(target.vertices[seen]).query(target.vertices)[0] / fit.pose.scale
    blind = target.without((apart < BLIND)[target.triangles].any(axis=1))
    telling = yield from part_of(fit_shape(space, blind, fit.pose, CHANGE, fit.coefficients), 0, 2)
    bare = target.without(glasses_seen(space, telling, target))
    return (yield from part_of(fit_shape(space, bare, telling.pose, CHANGE, telling.coefficients), 1, 2)), telling


def glasses_seen(space: ShapeSpace, telling: ShapeFit, target: Surface) -> np.ndarray:
    """(m,) bool: the triangles of ``target`` that show glasses, as a fit that is ``telling`` of them has it."""
    size, marks = telling.pose.scale, space.landmarks(telling.points)
    middle = np.mean([marks[f"{name}_{side}"] for name in ("en", "ex") for side in "lr"], axis=0)
    ears = np.mean([marks[f"t_{side}"] for side in "lr"], axis=0)
    ends = (ears - middle) @ telling.pose.turn[:, 1] / size - SIDES

    def about(points):
        _, y, z = ((points - middle) @ telling.pose.turn / size).T
        return (np.abs(z) < ACROSS) & (y < ends)

    near = np.flatnonzero(about(target.vertices))
    near = near[np.linalg.norm(target.vertices[near] - middle, axis=1) < (ends + BEFORE + REACH) * size]
    worn = things(target, near, standing_off(space, telling, target, near, about), size, HIGH, ANY)
    return worn[target.triangles].any(axis=1)


def before_eyes(space: ShapeSpace, fit: ShapeFit, target: Surface) -> np.ndarray:
    """(n,) bool: the vertices of ``target`` that stand plainly off the face laid on it about both eyes; else none."""
    size, marks = fit.pose.scale, space.landmarks(fit.points)
    every = np.zeros(len(target.vertices), dtype=bool)
    for side in "lr":
        middle = (marks[f"en_{side}"] + marks[f"ex_{side}"]) / 2
        x, y, z = ((target.vertices - middle) @ fit.pose.turn / size).T
        near = np.flatnonzero((np.abs(x) < BESIDE) & (np.abs(z) < ACROSS) & (-BEFORE < y) & (y < BEHIND))
        off = standing_off(space, fit, target, near, _anywhere)
        piece, area = pieces(target, off > PLAINLY)
        top = np.zeros(len(area))
        np.maximum.at(top, piece, off)
        high = (top > HIGH) & (area > ANY * size**2)
        if area[high].sum() < LEAST * size**2:
            return np.zeros_like(every)
        every |= high[piece] & (off > PLAINLY)
    return every


def _anywhere(points):
    return np.ones(len(points), dtype=bool)
