# SPDX-License-Identifier: GPL-3.0-or-later
"""A face laid on a scan in any turn: placements are tried coarsely, the likeliest fitted in full, and the best judged."""

from dataclasses import replace

import numpy as np

from ..adapt.closest import Surface
from ..adapt.scan_surface import NORMALS
from ..anatomy.head import Head
from ..errors import InputError
from ..mesh import Mesh
from ..progress import Work, portion
from ..scan.face_match import face_template
from ..scan.units import USUAL
from .any_size import face_of_any_size, of_human_size, of_most, resized
from .beards import above_beard, template_above
from .confidence import like_ears
from .head_of_body import body_scales, head_of_body, is_bust, may_be_bust, other_scales
from .infant import infant_points, infant_space
from .looking import FITTING, SIZE, TRIAL_MODES, facing_out, lies, looked, run
from .looks import LOOKS, ODDLY_SIZED, PARTS, PLAIN, QUICK, SIZED, THOROUGH, WHOLE
from .shape_fit import TRIAL, NoFaceError, ShapeFit, fit_shape
from .shape_space import ShapeSpace
from .verdict import ODD, judged, likeness_of, misfit_of, share_of, weighed

NO_FACE = (
    "No face is found in the scan: check that it shows one{}, or give landmarks with --landmarks or by clicking them."
)
#: mm on the reference by which the nose of an infant's face may lie lower than that of one laid on it upside down.
LOWER = (0.0, 30.0, 60.0)
#: What an odd face is bad as an infant's, of what it is as a grown one's, below which it is one. Six of MakeHuman's infants and
#: small children came to .23 to .78, a grown head that is cut off above the brows, in five turns, to .91 and more.
LESS_BAD = 0.85
#: Likeness of an ear (`like_ears`) below which a fit is begun again, and what the ears of both sides must gain by it. A CT
#: scan's left ear had .59 to .68 where it was laid a centimetre or more beside its place, .88 to .9 in it.
LIKELY_EARS, LIKELIER = 0.75, 0.1
#: mm by which a fit that is begun again from where it lies comes to lie elsewhere, root mean square over the face on a head of
#: the reference's size, if it was not at rest; and how often it is begun again. Fits of whole heads moved by up to 1.2.
AT_REST, AGAIN = 1.5, 2


def place_face(
    mesh: Mesh, reference: Head, space: ShapeSpace, unit_scales, any_size: bool = False, usual=USUAL
) -> Work:
    """Work returning mm per unit of the mesh, one of ``unit_scales``, the `ShapeFit`, the `Surface` it lies on and the
    `ShapeSpace` it is of, ``space`` or that of an infant.

    any_size : whether none of ``unit_scales`` may be right, so that the head is brought to the size of most people's if it
        is no person's in those
    usual : mm per unit in which it may be a body or a room then

    Raises
    ------
    InputError : there is no face in it.
    """
    template, grown, known, seen = face_template(reference), space, unit_scales, []

    def or_infant(result, less=LESS_BAD):
        return _or_infant(reference, result, less)

    def brought_to(scale):
        return place_face(mesh, reference, grown, [scale])

    def of_body(scales):
        return head_of_body(mesh, reference, grown, template, scales)

    def of_any_size():
        return face_of_any_size(mesh, reference, grown, face_template(reference), known, or_infant)

    sized = None
    if any_size and may_be_bust(mesh, unit_scales):
        sized = yield from portion(of_any_size(), 0.0, 0.3)
        if sized[0] is not None and is_bust(mesh, sized[0]):
            return (yield from portion(brought_to(sized[0]), 0.3, 1.0))
    head = yield from portion(of_body(unit_scales), 0.3 if sized else 0.0, 0.5)
    if head is not None:
        return (yield from portion(_placed_on(head, reference, [*known, *usual]), 0.5, 1.0))
    for look, (low, middle, high) in zip(LOOKS, PARTS, strict=True):
        if look.infant:
            space, template = infant_space(reference, grown), infant_points(reference, face_template(reference))
        elif look.above:
            space, template = above_beard(grown), template_above(grown, face_template(reference))
        split = (middle - low) / (high - low)
        seen += yield from portion(looked(look, mesh, reference, space, template, unit_scales, split), low, high)
        best = min(seen, key=_by_likeness if look.infant else lambda t: t[0]) if seen else None
        if best and _is_face(look, best):
            if look.infant:
                best = yield from portion(_or_turned_over(reference, best), high, 1.0)
            elif best[0].bad > ODD and not look.above:  # a face above a beard is no infant's
                best = yield from portion(or_infant(best), high, 1.0)
            _, scale, fit, _, of = best
            own = not any_size
            if any_size and scale in known:
                own = yield from portion(of_human_size(reference, best, lies(of, fit).scale, or_infant), high, 1.0)
            return best[1:] if own else (yield from portion(brought_to(of_most(best)), high, 1.0))
        if any_size and look is LOOKS[0] and (best is None or best[0].doubtful):
            head = yield from portion(of_body([x for x in body_scales(mesh, usual) if x not in known]), middle, high)
            if head is not None:
                return (yield from portion(_placed_on(head, reference, [*known, *usual]), high, 1.0))
            scale, closer = sized or (yield from portion(of_any_size(), high, SIZED))
            if scale is not None:
                return (yield from portion(brought_to(scale), SIZED, 1.0))
            head = yield from portion(
                of_body(other_scales(mesh, [*known, *body_scales(mesh, usual)], usual)), SIZED, ODDLY_SIZED
            )
            if head is not None:
                return (yield from portion(_placed_on(head, reference, [*known, *usual]), ODDLY_SIZED, 1.0))
            unit_scales = unit_scales or closer
    raise InputError(NO_FACE.format("" if any_size else " and that its unit (--units) is right"))


def _placed_on(head, reference, usual) -> Work:
    """Work returning what `place_face` does for a ``head`` out of a larger scan, what `head_of_body` returns: the face as it
    was seen, or begun from there on all around it, whichever fits better.

    What is around it may be cut from its part, as an ear, or be shoulders and chairs, on which neck and jaw lie worse. In no
    ``usual`` unit the head is brought to the size of most.
    """
    seen, around = head
    _, scale, fit, _, space = seen
    pose = lies(space, fit)
    target = facing_out(space, Surface(around.vertices * scale, around.triangles, smooth=NORMALS).coarser(), pose)
    rival = yield from _begun_from([pose], reference, scale, target, space)
    best = min((seen, rival), key=lambda t: t[0]) if rival else seen
    return (best if scale in usual else resized(reference, best, of_most(best) / scale))[1:]


def _is_face(look, result) -> bool:
    """Whether ``result``, one of those of `looked`, shows so much of a face that no other ``look`` is taken."""
    verdict, _, fit, _, space = result
    enough = verdict.likeness > PLAIN and (look.half or share_of(space, fit) > WHOLE)
    return not verdict.doubtful and (enough or look not in QUICK)


def at_rest(reference: Head, space: ShapeSpace, target: Surface, fit: ShapeFit) -> Work:
    """Work returning ``fit``, or, if that goes elsewhere when it is begun again from where it lies, what it comes to.

    Where a scan ends at the chin a fit may get stuck with the lower lip on the upper one and the chin on the lower lip, each on
    skin that faces its way.
    """
    for k in range(AGAIN):
        again = yield from run(begun_again(space, target, fit, SIZE), k / AGAIN, (k + 1) / AGAIN, FITTING)
        if again is None or judged(reference, space, again, THOROUGH.relief, target).doubtful:
            break
        if moved(space, fit, again) < AT_REST:
            break
        fit = again
    return fit


def moved(space: ShapeSpace, fit: ShapeFit, again: ShapeFit) -> float:
    """How far the face of ``again`` lies from that of ``fit``, root mean square in mm on a head of the reference's size."""
    far = np.linalg.norm(again.points - fit.points, axis=1)[space.face > 0.5]
    return float(np.sqrt(np.mean(far**2))) / fit.pose.scale


def with_likelier_ears(space: ShapeSpace, target: Surface, fit: ShapeFit) -> Work:
    """Work returning ``fit``, or one begun again from where the whole of it lies, if that has likelier ears.

    Turn and size of a face that went into its shape may leave an ear beside that of the scan, and a face fits as well.
    """
    before = like_ears(space, fit, target)
    if min(before.values()) >= LIKELY_EARS:
        return fit
    again = yield from run(begun_again(space, target, fit), 0.0, 1.0, FITTING)
    if again is None:
        return fit
    gain = sum(like_ears(space, again, target).values()) - sum(before.values())
    return again if gain > LIKELIER else fit


def begun_again(space: ShapeSpace, target: Surface, fit: ShapeFit, size: float | None = None):
    """A generator: yields the fraction done, returns a `ShapeFit` begun from where the whole of ``fit`` lies; None: it finds
    no face. ``size`` : as in `fit_shape`."""
    try:
        return (yield from fit_shape(space, target, lies(space, fit), size=size))
    except NoFaceError:
        return None


def _or_infant(reference, result, less) -> Work:
    """Work returning ``result``, one of those of `looked`, or one of an infant's face that is begun from where it lies, if
    that is less than ``less`` times as bad."""
    _, scale, fit, target, space = result
    infants = infant_space(reference, space)
    rival = yield from _begun_from([lies(space, fit)], reference, scale, target, infants)
    return rival if rival and not rival[0].doubtful and rival[0].bad < less * result[0].bad else result


def _or_turned_over(reference, result) -> Work:
    """Work returning ``result``, as in `_or_infant`, or one that is begun from there upside down, if that is likelier."""
    _, scale, fit, target, space = result
    rival = yield from _begun_from(_turned_over(space, fit), reference, scale, target, space)
    return min((result, rival), key=_by_likeness) if rival else result


def _begun_from(starts, reference, scale, target, space) -> Work:
    """Work returning a result as in `_or_infant` of the likeliest of ``starts``, poses; None: no face is there."""
    few, trials = space.reduced(TRIAL_MODES), []
    try:
        for k, start in enumerate(starts):
            part = (0.5 * (k + extra) / len(starts) for extra in (0, 1))
            trial = yield from run(fit_shape(few, target, start, TRIAL, every=3, size=SIZE), *part, FITTING)
            trials.append((weighed(misfit_of(few, trial), likeness_of(reference, few, trial), THOROUGH.weigh), trial))
        _, trial = min(trials, key=lambda t: t[0])
        work = fit_shape(space, target, trial.pose, coefficients=trial.coefficients, size=SIZE)
        fit = yield from run(work, 0.5, 1.0, FITTING)
    except NoFaceError:
        return None
    return judged(reference, space, fit, THOROUGH.relief, target), scale, fit, target, space


def _turned_over(space, fit):
    """Where a face may lie that ``fit`` has upside down, poses: its nose is on the nose, or lower, from that on the brow."""
    pose, nose = lies(space, fit), space.landmarks(space.points)["prn"]
    turn = pose.turn * [-1.0, 1.0, -1.0]
    places = (space.landmarks(fit.points)["prn"] - pose.scale * turn[:, 2] * low for low in LOWER)
    return [replace(pose, turn=turn, shift=place - pose.scale * turn @ nose) for place in places]


def _by_likeness(result):
    """What ``result``, one of those of `looked`, is sorted by where an infant's face may be: how
    like a face the scan is, its ears included.

    A round face upside down, the chin for a forehead, fits as well as a true one, or better where eyes are holes; but its
    relief is less like a face's, and its ears are beside theirs.
    """
    verdict, _, fit, target, space = result
    ears = np.mean(list(like_ears(space, fit, target).values()))
    return verdict.doubtful, -verdict.likeness * (0.5 + ears)
