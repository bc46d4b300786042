# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair that falls on the forehead, or a cap: what is rough above the brows of a face that is not rough elsewhere.

A plausible head laid on the scan (`shape_fit`) follows a fringe as if it were the forehead. Laid on the rest of the face alone
it tells what is fringe: what is as rough, or stands off it. How far below the skin lies is found with that of the other hair
(`under_hair`).
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from ..adapt.closest import Surface
from .looking import SIZE
from .shape_fit import CHANGE, NoFaceError, ShapeFit, fit_shape, part_of
from .shape_space import ShapeSpace
from .under_hair import AROUND, MANY, MOSTLY, SMOOTH, UNEVEN, forehead, hair_over, over, varied, within

#: mm on the reference: how high above the brows, and how far to the sides, a forehead is bare unless something hides it; how
#: far below them, and outside of the eyes, a fringe may come.
LOW, WIDE, UNDER_BROWS, OUTSIDE = 22.0, 40.0, 3.0, 8.0
EAR = 0.05  # of `ShapeSpace.ear`, from which on skin is an ear
#: rad by which normals vary over a fringe, at least, and that in terms of the cheeks'; mm by which heights do.
ROUGH, ROUGHER, RAGGED = 0.2, 1.5, 0.8
#: Share of the low forehead that is so: of four fringes .46 and more, under caps and a headband .43 and more, in a hood .32, of
#: one man whose hair grows down to a brow .48 and .20; of a scan of 3,000 triangles .12; of 23 others, noisy and real ones
#: among them, none at all.
SHARE = 0.25
HIGH = 6.0  # mm off the head laid on the rest, from which on it is fringe whether rough or not
MOST = 0.4  # of what lies about a point of the skin, from which on it lies under a fringe
ABOUT = 8.0  # mm to which it is what lies beside that
CHEEK = (8.0, 4.0, 18.0)  # mm: how far below the eyes cheeks begin, below the nose they end, off the middle they are


def fringe_zone(space: ShapeSpace) -> np.ndarray:
    """(n,) bool: the points of the skin over which a fringe may fall: scalp, forehead and temples."""
    marks = space.landmarks(space.points)
    x, _, z = space.points.T
    temples = (np.abs(x) > marks["ex_l"][0] + OUTSIDE) & (z > marks["al_l"][2])
    return space.hairy | ((space.ear < EAR) & (temples | (z > _brows(marks) - UNDER_BROWS)))


def has_fringe(space: ShapeSpace, fit: ShapeFit, target: Surface) -> bool:
    """Whether something rough lies low on the forehead of the face laid on the scan ``target``."""
    x, _, z = space.points.T
    low = forehead(space) & (z < _brows(space.landmarks(space.points)) + LOW) & (np.abs(x) < WIDE)
    _, near, rough, uneven, _ = _looks(space, fit, target, low | _cheeks(space))
    there = low[near]
    return bool(there.any() and np.mean(rough[there] & (uneven[there] > RAGGED)) > SHARE)


def fit_without_fringe(space: ShapeSpace, target: Surface, fit: ShapeFit):
    """A generator: yields the fraction done, returns a `ShapeFit` to the scan ``target`` without a fringe, and (n,) bool, the
    points of the skin over which that is; ``fit`` and none where there is none, or too little of a face beside it."""
    none = np.zeros(len(fit.points), dtype=bool)
    if not has_fringe(space, fit, target):
        return fit, none
    zone = fringe_zone(space)
    elsewhere = replace(space, area=np.where(zone, 0.0, space.area))
    try:
        rest = yield from part_of(fit_shape(elsewhere, target, fit.pose, CHANGE, fit.coefficients, size=SIZE), 0, 2)
        middle, near, rough, uneven, high = _looks(space, rest, target, zone | _cheeks(space))
        hair = (rough & (uneven > UNEVEN)) | (high > HIGH)
        at, covered = np.flatnonzero(zone), none.copy()
        link = within(rest.points[at], rest.points[near], MOSTLY * rest.pose.scale)
        covered[at] = link @ hair / np.maximum(np.asarray(link.sum(axis=1)).ravel(), 1) > MOST
        if covered.any():
            covered = zone & (cKDTree(space.points[covered]).query(space.points)[0] < ABOUT)
        bare = target.without(hair_over(space, rest, target, covered))
        work = fit_shape(space, bare, rest.pose, CHANGE, rest.coefficients, size=SIZE)
        return (yield from part_of(work, 1, 2)), covered
    except NoFaceError:
        return fit, none


def left_beside(haired: Surface, under, worn) -> Surface:
    """The scan ``haired`` without what is ``worn`` (k,) bool: triangles of those that are not ``under`` (m,) bool a fringe."""
    out = np.zeros(len(under), dtype=bool)
    out[~under] = worn
    return haired.without(out)


def _brows(marks) -> float:
    return max(marks["sci_l"][2], marks["sci_r"][2])


def _cheeks(space):
    """(n,) bool: skin that nothing hides as a rule, and that is smooth: it tells how noisy a scan is."""
    marks = space.landmarks(space.points)
    x, _, z = space.points.T
    below_eyes, below_nose, aside = CHEEK
    high = (z < marks["en_l"][2] - below_eyes) & (z > marks["sn"][2] - below_nose)
    return (space.face > 0.5) & high & (np.abs(x) > aside)


def _looks(space, fit, target, zone):
    """Of the triangles of the scan over a ``zone`` (n,) bool: middles (k, 3) mm, the points of the skin (k,) nearest to them,
    whether they are rough (k,) bool, mm by which heights vary about them (k,), and mm by which they stand off (k,), both on a
    head of the reference's size."""
    size, coarse = fit.pose.scale, target.coarser()
    middle, near, off, high = over(fit, space, coarse, slice(None, None, max(len(coarse.triangles) // MANY, 1)))
    some = (near >= 0) & ((off**2).sum(axis=1) < 2.0) & zone[near]
    middle, near, off, high = middle[some], near[some], off[some], high[some] / size
    rough, uneven = (varied(middle, values, AROUND * size) for values in (off, high[:, None]))
    smooth = rough[_cheeks(space)[near]]
    usual = np.percentile(smooth, SMOOTH) if len(smooth) else 0.0
    return middle, near, rough > max(ROUGH, ROUGHER * usual), uneven, high
