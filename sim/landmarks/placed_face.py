# SPDX-License-Identifier: GPL-3.0-or-later
"""A face laid on a scan in any turn: placements are tried coarsely, the likeliest fitted in full, and the best judged."""

from dataclasses import replace

import numpy as np

from ..adapt.closest import Surface
from ..adapt.scan_surface import NORMALS, cuts_of
from ..adapt.thin_plate_spline import similarity
from ..anatomy.head import Head
from ..errors import InputError
from ..mesh import Mesh, vertex_normals
from ..progress import Progress, Work, portion
from ..scan.face_match import face_template, surface_samples
from ..scan.flat_cuts import beyond
from .confidence import like_ears
from .infant import infant_points, infant_space
from .looks import CLEAR, LOOKS, PARTS, PLAIN, QUICK, WHOLE, templates_of
from .pose_search import LOOKING, Pose, search_poses
from .shape_fit import LEAST, TRIAL, NoFaceError, ShapeFit, fit_shape
from .shape_space import ShapeSpace
from .verdict import ODD, judged, likeness_of, misfit_of, share_of, weighed

FITTING = "Fitting a face"
NO_FACE = (
    "No face is found in the scan: check that it shows one, or give landmarks with --landmarks or by clicking them."
)
TRIAL_MODES = 40
#: Standard deviation of heads' size, as its logarithm, about the likeliest. Of adults it is .026 in one sex (head
#: circumference in ANSUR, Gordon et al. 1989), and women's heads are 4 % smaller than men's; children's are smaller yet. Where
#: a scan shows much of a head this tells little; where a face is cut off all round it keeps size and shape apart.
SIZE = 0.05
#: mm on the reference by which the nose of an infant's face may lie lower than that of one laid on it upside down.
LOWER = (0.0, 30.0, 60.0)
#: What an odd face is bad as an infant's, of what it is as a grown one's, below which it is one. Six of MakeHuman's infants and
#: small children came to .23 to .78, a grown head that is cut off above the brows, in five turns, to .91 and more.
LESS_BAD = 0.85
TURNS = 3  # times that a fit is begun again
#: Likeness of an ear (`like_ears`) below which a fit is begun again, and what the ears of both sides must gain by it. A CT
#: scan's left ear had .59 to .68 where it was laid a centimetre or more beside its place, .88 to .9 in it.
LIKELY_EARS, LIKELIER = 0.75, 0.1


def place_face(mesh: Mesh, reference: Head, space: ShapeSpace, unit_scales) -> Work:
    """Work returning mm per unit of the mesh, one of ``unit_scales``, the `ShapeFit`, the `Surface` it lies on and the
    `ShapeSpace` it is of, ``space`` or that of an infant.

    Raises
    ------
    InputError : there is no face in it.
    """
    template, samples = face_template(reference), surface_samples(mesh)
    seen = []
    for look, (low, middle, high) in zip(LOOKS, PARTS, strict=True):
        if look.infant:
            space, template = infant_space(reference, space), infant_points(reference, template)
        few = space.reduced(TRIAL_MODES)
        trials = []
        for k, scale in enumerate(unit_scales):
            part = (low + (middle - low) * (k + extra) / len(unit_scales) for extra in (0, 1))
            trials += yield from portion(_trials(look, reference, few, mesh, samples, template, scale), *part)
        trials.sort(key=lambda t: t[0])
        good = sum(t[0] < look.worse * trials[0][0] for t in trials[: look.most])
        rivals = trials[: look.further]
        results = yield from portion(_fits(look, reference, space, few, rivals, good), middle, high)
        seen += [(*result, space) for result in results]
        if not seen:
            continue
        best = min(seen, key=_by_likeness if look.infant else lambda t: t[0])
        verdict = best[0]
        enough = verdict.likeness > PLAIN and (look.half or share_of(space, best[2]) > WHOLE)
        if not verdict.doubtful and (enough or look not in QUICK):
            if look.infant:
                best = yield from portion(_or_turned_over(reference, best), high, 1.0)
            elif verdict.bad > ODD:
                best = yield from portion(_or_infant(reference, best), high, 1.0)
            return best[1:]
    raise InputError(NO_FACE)


def _trials(look, reference, few, mesh, samples, template, scale) -> Work:
    """Work returning placements of the face in a mesh of ``scale`` mm per unit: misfit as the ``look`` weighs it, scale,
    `ShapeFit`, `Surface`.

    No face is looked for on flat ends; where there is nothing else, there is none.
    """
    target = Surface(mesh.vertices * scale, mesh.triangles, smooth=NORMALS).coarser()
    ends = cuts_of(target)
    samples = samples[~beyond(ends, samples * scale)]
    if len(samples) < LEAST:
        return []
    poses, trials, parts = [], [], templates_of(look, template)
    for k, part in enumerate(parts):
        work = search_poses(samples * scale, look.size * part, look.tried, look.starts, look.survivors)
        poses += yield from portion(work, 0.5 * k / len(parts), 0.5 * (k + 1) / len(parts))
    yield Progress(0.5, LOOKING)
    for k, pose in enumerate(poses):
        pose = replace(pose, scale=pose.scale * look.size)
        outward = facing_out(few, target, pose)
        part = (0.5 + 0.5 * (k + extra) / len(poses) for extra in (0, 1))
        try:
            fit = yield from run(fit_shape(few, outward, pose, TRIAL, every=3, size=SIZE), *part, LOOKING)
        except NoFaceError:
            continue
        misfit = weighed(misfit_of(few, fit), likeness_of(reference, few, fit), look.weigh)
        trials.append((misfit, scale, fit, outward))
    return trials


def _fits(look, reference, space, few, rivals, good) -> Work:
    """Work returning the ``rivals`` (`_trials`) fitted in full: `Verdict`, scale, `ShapeFit`, `Surface`.

    The first ``good`` of them are; the others while none shows a face, and they must show as much of one as in a thorough
    look, because the more places are tried, the more like a face is the best of them by chance. While none is clearly a
    face, those most like one are begun again from where the whole of them lies now, as long as that makes them more like
    one: a trial knows turn and size of a face to ten degrees and a tenth; what those are off goes into the shape, and
    comes out of it only bit by bit.
    """
    results = []
    for k, (_, scale, fit, target) in enumerate(rivals):
        if k >= good and _any_face(results):
            break
        work = fit_shape(space, target, fit.pose, coefficients=fit.coefficients, size=SIZE)
        try:
            fit = yield from run(work, *(0.5 * (k + np.arange(2)) / len(rivals)), FITTING)
        except NoFaceError:
            continue
        relief = look.relief if k < good else LOOKS[-1].relief
        results.append((judged(reference, space, fit, relief), scale, fit, target))
    parts = iter(np.linspace(0.5, 1.0, look.again * TURNS + 1))
    done = next(parts)
    likely = sorted(results, key=lambda t: -t[0].likeness)[: look.again]
    for k, (verdict, scale, fit, target) in enumerate(likely):
        if k and _any_face(results):
            break
        for _ in range(TURNS):
            if max(t[0].likeness for t in results) > CLEAR:
                return results
            done, before, start = next(parts), done, verdict
            try:
                work = fit_shape(few, target, _lies(space, fit), TRIAL, every=3, size=SIZE)
                fit = yield from run(work, before, (3 * before + done) / 4, FITTING)
                work = fit_shape(space, target, fit.pose, coefficients=fit.coefficients, size=SIZE)
                fit = yield from run(work, (3 * before + done) / 4, done, FITTING)
            except NoFaceError:
                break
            verdict = judged(reference, space, fit, LOOKS[-1].relief)
            results.append((verdict, scale, fit, target))
            if verdict.likeness < start.likeness + 0.01:
                break
    return results


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
        return (yield from fit_shape(space, target, _lies(space, fit), size=size))
    except NoFaceError:
        return None


def _or_infant(reference, result) -> Work:
    """Work returning ``result``, one of those of `_fits` with the `ShapeSpace` it is of, or one of an infant's face that is
    begun from where it lies, if that is plainly less bad."""
    _, scale, fit, target, space = result
    infants = infant_space(reference, space)
    rival = yield from _begun_from([_lies(space, fit)], reference, scale, target, infants)
    return rival if rival and not rival[0].doubtful and rival[0].bad < LESS_BAD * result[0].bad else result


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
            trials.append((weighed(misfit_of(few, trial), likeness_of(reference, few, trial), LOOKS[-1].weigh), trial))
        _, trial = min(trials, key=lambda t: t[0])
        work = fit_shape(space, target, trial.pose, coefficients=trial.coefficients, size=SIZE)
        fit = yield from run(work, 0.5, 1.0, FITTING)
    except NoFaceError:
        return None
    return judged(reference, space, fit, LOOKS[-1].relief), scale, fit, target, space


def _turned_over(space, fit):
    """Where a face may lie that ``fit`` has upside down, poses: its nose is on the nose, or lower, from that on the brow."""
    pose, nose = _lies(space, fit), space.landmarks(space.points)["prn"]
    turn = pose.turn * [-1.0, 1.0, -1.0]
    places = (space.landmarks(fit.points)["prn"] - pose.scale * turn[:, 2] * low for low in LOWER)
    return [replace(pose, turn=turn, shift=place - pose.scale * turn @ nose) for place in places]


def _by_likeness(result):
    """What ``result``, one of those of `_fits` with the `ShapeSpace` it is of, is sorted by where an infant's face may be: how
    like a face the scan is, its ears included.

    A round face upside down, the chin for a forehead, fits as well as a true one, or better where eyes are holes; but its
    relief is less like a face's, and its ears are beside theirs.
    """
    verdict, _, fit, target, space = result
    ears = np.mean(list(like_ears(space, fit, target).values()))
    return verdict.doubtful, -verdict.likeness * (0.5 + ears)


def _any_face(results):
    """Whether one of ``results`` (`_fits`) is taken for a face."""
    return not all(verdict.doubtful for verdict, *_ in results)


def _lies(space, fit) -> Pose:
    """How the whole of ``fit`` lies, its shape included."""
    matrix, shift = similarity(space.points, fit.points)
    size = float(np.cbrt(np.linalg.det(matrix)))
    return Pose(size, matrix / size, shift, fit.pose.misfit)


def facing_out(space: ShapeSpace, target: Surface, pose: Pose) -> Surface:
    """The scan ``target``, turned inside out if its normals face away from those of a skin at ``pose``."""
    points = pose.scale * space.points @ pose.turn.T + pose.shift
    face = space.face > 0.5
    normals = vertex_normals(points, space.triangles)
    return target.turned() if target.inside_out(points[face], normals[face], 15.0) else target


def run(work, start: float, stop: float, label: str) -> Work:
    """Work returning what ``work``, which yields the fraction done, returns."""
    while True:
        try:
            done = next(work)
        except StopIteration as end:
            return end.value
        yield Progress(start + (stop - start) * done, label)
