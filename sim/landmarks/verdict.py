# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether what a skin was laid on is a face: how near it lies, and how much of a face's relief is there."""

from typing import NamedTuple

import numpy as np

from ..adapt.closest import Surface
from ..adapt.relief import face_likeness
from ..anatomy.head import Head
from .confidence import like_ears
from .shape_fit import ShapeFit
from .shape_space import ShapeSpace

POOR = 2.6  # mm on a head of the reference's size: a mean distance in the face above which there is none
#: The same where the scan has as much relief of a face as few other things have, and either ``HALF`` of one, as if seen from
#: the side, or less but that plainly: no more than ``ODDER`` bad. The less of a face is laid on anything, the more its relief
#: is like one by chance: ears .94 with a fifth, necks .91 with a third, a chin on a mouth .9 with .53; of faces seen from up to
#: 35 degrees beside them (MakeHuman's and scans, with noise and holes) .58 and more is there, with .87 and more. Crops of
#: faces, noisy and with holes, with a third to a half of them are up to 7.6 bad, what is none 9 and more.
SURE, LITTLE = 0.85, 5.0
HALF, ODDER = 0.55, 8.2
#: How bad a fit is, above which the relief must be more like a face than chance finds one, and above which there is none. Faces
#: are up to 6 bad, one cut off below and above with a tube in its mouth 12 with a likeness of .76; necks, sides of heads and
#: bumpy balls 8 to 18 with up to .70, and tiny faces on parts of a true one 22 with .74.
ODD, PLAINLY, NONE = 7.0, 0.72, 15.0
#: An ear in its place beside as much relief tells a face that shows so little, or is so unlike most, that these would not: how
#: like one both must be, and how bad it may be. Of 54 heads of which half or a third was cut away, some noisy, some cut above
#: the brows or about the chin, three right fits were .85 to .93 like a face, .82 to .9 like an ear and 10 to 16 bad. Of 222
#: wrong ones the lesser likeness was at most .71; a chin on a mouth was .91 like a face, and .3 like an ear.
EARED, ODDEST = 0.8, 20.0
#: Size, as its logarithm, that makes a fit twice as bad; half as much tells next to nothing. Small faces, a child's
#: and the CT's, are .75 of the reference's (.29 less), and some scans 1.2; the side of a head would pass for a face of .7.
ODD_SIZE = 0.42


class Verdict(NamedTuple):
    """Whether a fit is doubtful as a face, how bad it is, and how much relief of a face the scan has under it."""

    doubtful: bool
    bad: float
    likeness: float


def judged(reference: Head, space: ShapeSpace, fit: ShapeFit, relief: float, target: Surface | None = None) -> Verdict:
    """What to think of ``fit``, for which ``relief`` is enough. An ear is looked for on the ``target`` it lies on, if given.

    Likeness counts twice, and how unlikely shape and size are counts as well: a skin that was bent far enough lies near
    anything, and a face upside down, its nose on the nose, has as much relief as a true one.
    """
    misfit, likeness = misfit_of(space, fit), likeness_of(reference, space, fit)
    shape, size = np.mean(fit.coefficients**2), (np.log(fit.pose.scale / space.size) / ODD_SIZE) ** 6
    bad = weighed(misfit, likeness, 2) * (1 + shape) * (1 + size)
    plain = likeness > SURE and (share_of(space, fit) > HALF or bad < ODDER)
    most = LITTLE if plain else POOR
    enough = max(relief, PLAINLY) if bad > ODD else relief
    doubtful = misfit > most or likeness < enough or bad > NONE
    if doubtful and target is not None and likeness > EARED and misfit < LITTLE and bad < ODDEST:
        doubtful = max(like_ears(space, fit, target).values()) < EARED
    return Verdict(doubtful, float(bad), likeness)


def weighed(misfit: float, likeness: float, power: float) -> float:
    """The ``misfit`` of a skin where the scan has that ``likeness`` of a face, which counts ``power`` times."""
    return misfit / max(likeness, 0.1) ** power


def likeness_of(reference: Head, space: ShapeSpace, fit: ShapeFit) -> float:
    """How much relief of a face the scan has where the skin was laid on it, see `adapt.relief`."""
    skin = reference.skin.vertices @ fit.matrix.T + fit.pose.shift
    fitted = np.zeros(len(skin))
    skin[space.vertices], fitted[space.vertices] = fit.points, fit.trust * (space.area > 0)
    return face_likeness(reference, skin, fitted)


def share_of(space: ShapeSpace, fit: ShapeFit) -> float:
    """How much of the face found the scan, 0..1."""
    return float(np.average(np.isfinite(fit.distance), weights=_face_area(space)))


def misfit_of(space: ShapeSpace, fit: ShapeFit) -> float:
    """Mean distance of the face to the scan, mm; what found nothing counts as far."""
    distance = np.where(np.isfinite(fit.distance), np.abs(fit.distance), 6.0)
    return float(np.average(distance, weights=_face_area(space))) / fit.pose.scale


def _face_area(space):
    """(n,) mm² of the face that each point stands for."""
    return space.area * (space.face > 0.5)
