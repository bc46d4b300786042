# SPDX-License-Identifier: GPL-3.0-or-later
"""A face that something about the mouth led astray: the lips of a bearded one were laid in a furrow of the beard.

Jaw and chin take up so much of a face that a skin follows a beard as if it were they, mouth and all. Laid without regard to
where beards grow, its lips find the scan's. If it then has a beard (`beards`), it is laid on what lies beside that. If not, it
is laid on all of the scan again, in case that it lies amiss for other reasons, under a cap for one, and is much better so.
"""

from ..adapt.closest import Surface
from ..anatomy.head import Head
from ..progress import Work
from .beards import SHARE, THICK, above_beard, fit_beside, grows_beard, lips_beside, rough_chin, thick_beard
from .expression import cost
from .looking import FITTING, SIZE, lies, run
from .shape_fit import SCHEDULE, NoFaceError, ShapeFit, fit_shape
from .shape_space import ShapeSpace
from .verdict import judged

FROM = SCHEDULE[18:]  # with which a skin is laid on all of the scan from there
#: mm that the lips lie off the scan, and how bad a face is, from which on one is doubted: most neutral ones stay below both.
OFF, BAD = 1.3, 3.0
#: How much nearer to the scan the rest of the face lies without regard to a beard: of 11 beards and moustaches made for as many
#: people .52 to .83, of a goatee .92, with an open mouth 1.03; of 50 other faces .81 and more, under a cap .73.
NEARER = 0.78
#: How bad a face is against what it was, if it had lain amiss: two under caps .45 and .63, others .86 and more.
BETTER = 0.75
#: How much nearer to the scan the lips of a face with a rough chin lie without regard to a beard, and then on the scan beside
#: it: of 14 beards .31 to .70 and .31 to .90, of a moustache .52 and .76, of a goatee .68 and .97; of noisy scans, caps and
#: collars .71 and 1.05 and more. Of two thick beards, in whose furrows lips lay as near, .59 and .70, .94 and 1.03.
ABOVE, BESIDE, FURROW = 0.75, 0.95, 0.9


def without_beards_lead(
    reference: Head, space: ShapeSpace, target: Surface, fit: ShapeFit, above: bool = False, rough: bool = False
) -> Work:
    """Work returning a `ShapeFit` to the scan ``target`` without a beard, and the `Beard`; ``fit``, or one begun from the upper
    face and the lips, and None where there is none, as that is nearer to the scan, or all is much better.

    above : whether ``fit`` was laid without regard to a beard; rough : whether one is looked for on rough chins only
    """
    beard, lips = grows_beard(space), lips_beside(space)
    face = (space.face > 0.5) & ~beard
    verdict = judged(reference, space, fit, 0.0)
    is_rough, shaggy = rough_chin(space, fit, target)
    doubted = cost(space, fit, lips) > OFF or verdict.bad > BAD
    if not (above or shaggy or doubted and (is_rough or not rough)):
        return fit, None
    try:
        rival = fit
        if not above:
            work = fit_shape(above_beard(space), target, lies(space, fit), size=SIZE)
            rival = yield from run(work, 0.0, 0.6, FITTING)
        off, nearer = cost(space, fit, lips), cost(space, rival, lips)
        if above or (is_rough and nearer < FURROW * off):
            seen = thick_beard(space, rival, target)
            beside, share = yield from run(fit_beside(space, seen, target), 0.6, 0.7, FITTING)
            found = nearer < ABOVE * off and cost(space, beside, lips) < BESIDE * off
            if share > THICK or (share > SHARE and (found or above)):
                return beside, seen
        work = fit_shape(space, target, rival.pose, FROM, rival.coefficients, size=SIZE)
        again = yield from run(work, 0.7, 1.0, FITTING)
    except NoFaceError:
        return fit, None
    nearer = cost(space, rival, face) < NEARER * cost(space, fit, face)
    better = above or nearer or judged(reference, space, again, 0.0).bad < BETTER * verdict.bad
    return (again if better else fit), None
