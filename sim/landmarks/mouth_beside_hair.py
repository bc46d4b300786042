# SPDX-License-Identifier: GPL-3.0-or-later
"""The mouth of a face beside hair.

Before it is known what is hair, curtains of it beside the cheeks pull at a face. Of seventeen people with hair made for
them one got a mouth a centimetre too high, out of which no later fit found: the lips did not meet where the scan's do.
Looked for anew, in the knowledge of what is hair, they do.
"""

from ..adapt.closest import Surface
from .expression import line_of
from .shape_fit import SCHEDULE, Expression, fit_shape
from .shape_space import ShapeSpace
from .under_hair import UnderHair, beside_face


def with_mouth_again(space: ShapeSpace, target: Surface, hair: UnderHair, shown: Expression):
    """A generator: yields the fraction done, returns a `ShapeFit` to the scan ``target`` that begins anew, in the knowledge of
    ``hair``, if that finds where closed lips meet and the one there is does not; else None."""
    if not hair.covered.any() or shown.parted or line_of(space, hair.fit, target) is not None:
        return None
    unseen = hair.covered | beside_face(space, hair.fit, hair.hidden)
    again = yield from fit_shape(space, target, hair.fit.pose, SCHEDULE, None, 1, shown, None, unseen)
    return again if line_of(space, again, target) is not None else None
