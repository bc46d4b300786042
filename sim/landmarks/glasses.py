# SPDX-License-Identifier: GPL-3.0-or-later
"""Glasses, their lenses too where a scanner sees those and not through them: they stand off the face before both eyes.

Lenses take up so much of a face that a plausible head laid on the scan (`shape_fit`) is drawn toward them. Once it is seen
that there are glasses, it is laid on what lies beside them, and tells what of the rest is skin.
"""

import numpy as np

from ..adapt.closest import Surface
from .shape_fit import CHANGE, Expression, NoFaceError, ShapeFit, fit_shape, part_of
from .shape_space import ShapeSpace
from .things import REACH, high_pieces, standing_off, things

#: mm, all on a head of the reference's size. Frames and lenses of six kinds on the faces of five people, made up and scanned by
#: virtual devices, stand off by 9 and more, over 110 mm² of more than 4 at each eye; 23 faces without any by at most 5 over
#: 26, and by 14, specks of a scan, over 24. Wire as thin as 2 mm, scanned in bits, stands off over 18: it is not seen.
BESIDE, ACROSS, BEFORE, BEHIND = 38.0, 32.0, 45.0, 25.0  # from the middle of an eye that is looked at
EYE = (18.0, 11.0)  # half of what is not, where eyelashes and eyeballs are
PLAINLY, HIGH = 4.0, 7.5  # that they stand off plainly; somewhere at each eye
LEAST = 75.0  # mm² of each eye's that do so
ANY = 40.0  # mm² of a piece of them
SIDES = 12.0  # before the ears' canals, at which their sides are given up
BEFORE_SKIN = 20.0  # to which they hide skin behind them
#: As the reference's eyes: where nothing shows the lids, the skin around them would open or shut them anyhow.
OPEN = Expression(wide=True)


def fit_without_glasses(space: ShapeSpace, target: Surface, fit: ShapeFit):
    """A generator: yields the fraction done, returns a `ShapeFit` to the scan ``target`` without glasses, and one that tells
    what those are (`glasses_seen`); ``fit`` and None where there are none, or too little of a face beside them."""
    unheeded = about_glasses(space, fit, target)
    if not unheeded.any():
        return fit, None
    blind = target.without(unheeded[target.triangles].any(axis=1))
    try:
        work = fit_shape(space, blind, fit.pose, CHANGE, fit.coefficients, 1, OPEN)
        telling = yield from part_of(work, 0, 2)
        bare = target.without(glasses_seen(space, telling, target))
        work = fit_shape(space, bare, telling.pose, CHANGE, telling.coefficients, 1, OPEN)
        return (yield from part_of(work, 1, 2)), telling
    except NoFaceError:
        return fit, None


def glasses_seen(space: ShapeSpace, telling: ShapeFit | None, target: Surface) -> np.ndarray:
    """(m,) bool: the triangles of ``target`` that show glasses, as a fit that is ``telling`` of them has it; None: none do."""
    if telling is None:
        return np.zeros(len(target.triangles), dtype=bool)
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


def about_glasses(space: ShapeSpace, fit: ShapeFit, target: Surface) -> np.ndarray:
    """(n,) bool: the vertices of ``target`` as far about both eyes as something stands plainly off the face laid on it; none if
    it does not at both."""
    size, marks = fit.pose.scale, space.landmarks(fit.points)
    every = np.zeros(len(target.vertices), dtype=bool)
    for side in "lr":
        middle = (marks[f"en_{side}"] + marks[f"ex_{side}"]) / 2
        x, y, z = ((target.vertices - middle) @ fit.pose.turn / size).T
        window = (np.abs(x) < BESIDE) & (np.abs(z) < ACROSS) & (-BEFORE < y) & (y < BEHIND)
        near = np.flatnonzero(window & ((x / EYE[0]) ** 2 + (z / EYE[1]) ** 2 > 1))
        high = high_pieces(target, standing_off(space, fit, target, near), PLAINLY, HIGH, ANY * size**2)
        if target.area[high[target.triangles].all(axis=1)].sum() < LEAST * size**2:
            return np.zeros_like(every)
        wide, low, up = np.abs(x[high]).max(), z[high].min(), z[high].max()
        every |= window & (np.abs(x) <= wide) & (low <= z) & (z <= up)
    return every
