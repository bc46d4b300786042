# SPDX-License-Identifier: GPL-3.0-or-later
"""A face that something about the mouth led astray: the lips of a bearded one were laid in a furrow of the beard.

Jaw and chin take up so much of a face that a skin follows a beard as if it were they, mouth and all. Laid without regard to
where beards grow, its lips find the scan's. From there it is laid on all of the scan again. So is one that lies amiss for
other reasons, under a cap for one, if that makes it much better.
"""

from dataclasses import replace

import numpy as np

from ..adapt.closest import Surface
from ..anatomy.head import Head
from ..progress import Work
from .expression import cost
from .looking import FITTING, SIZE, lies, run
from .shape_fit import SCHEDULE, NoFaceError, ShapeFit, fit_shape
from .shape_space import ShapeSpace
from .verdict import judged

#: mm on the reference: how far from the middle the upper border of a beard begins to rise, and how steeply; how far it stays
#: below the ears, and goes behind them, and below the chin; and beyond the lips' red.
BESIDE, STEEP, UNDER_EAR, BEHIND, UNDER_CHIN, ROUND_LIPS = 22.0, 0.75, 5.0, 2.0, 35.0, 3.0
AWAY = 0.05  # of `ShapeSpace.ear`, from which on skin is an ear
FROM = SCHEDULE[18:]  # with which a skin is laid on all of the scan from there
#: mm that the lips lie off the scan, and how bad a face is, from which on one is doubted: most neutral ones stay below both.
OFF, BAD = 1.3, 3.0
#: How much nearer to the scan the rest of the face lies without regard to a beard: of 11 beards and moustaches made for as many
#: people .52 to .83, of a goatee .92, with an open mouth 1.03; of 50 other faces .81 and more, under a cap .73.
NEARER = 0.78
#: How bad a face is against what it was, if it had lain amiss: two under caps .45 and .63, others .86 and more.
BETTER = 0.75


def grows_beard(space: ShapeSpace) -> np.ndarray:
    """(n,) bool: the points of the skin where beards grow: below a line from the nose to the ears, without the lips' red."""
    marks = space.landmarks(space.points)
    x, y, z = space.points.T
    rising = marks["sn"][2] - 1 + STEEP * np.clip(np.abs(x) - BESIDE, 0, None)
    below = z < np.minimum(rising, marks["t_l"][2] - UNDER_EAR)
    wide, high = marks["ch_l"][0] + ROUND_LIPS, (marks["ls"][2] - marks["li"][2]) / 2 + ROUND_LIPS
    red = (x / wide) ** 2 + ((z - marks["sto"][2]) / high) ** 2 < 1
    there = below & ~red & (z > marks["gn"][2] - UNDER_CHIN)
    return there & (y < marks["t_l"][1] + BEHIND) & (space.ear < AWAY)


def without_beards_lead(reference: Head, space: ShapeSpace, target: Surface, fit: ShapeFit) -> Work:
    """Work returning ``fit``, or one begun from the upper face and the lips, if those are nearer to the scan then, or all is
    much better."""
    beard = grows_beard(space)
    face = (space.face > 0.5) & ~beard
    lips = face & (space.points[:, 2] < space.landmarks(space.points)["sn"][2])
    verdict = judged(reference, space, fit, 0.0)
    if cost(space, fit, lips) < OFF and verdict.bad < BAD:
        return fit
    blind = replace(space, area=np.where(beard, 0.0, space.area))
    try:
        above = yield from run(fit_shape(blind, target, lies(space, fit), size=SIZE), 0.0, 0.7, FITTING)
        work = fit_shape(space, target, above.pose, FROM, above.coefficients, size=SIZE)
        again = yield from run(work, 0.7, 1.0, FITTING)
    except NoFaceError:
        return fit
    nearer = cost(space, above, face) < NEARER * cost(space, fit, face)
    return again if nearer or judged(reference, space, again, 0.0).bad < BETTER * verdict.bad else fit
