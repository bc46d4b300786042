# SPDX-License-Identifier: GPL-3.0-or-later
"""One look for a face: placements are tried coarsely, and the likeliest fitted in full."""

from dataclasses import replace

import numpy as np

from ..adapt.closest import Surface
from ..adapt.scan_surface import NORMALS, cuts_of
from ..adapt.thin_plate_spline import similarity
from ..anatomy.head import Head
from ..mesh import Mesh, vertex_normals
from ..progress import Progress, Work, portion
from ..scan.face_match import surface_samples
from ..scan.flat_cuts import beyond
from .looks import CLEAR, THOROUGH, Look, templates_of
from .pose_search import LOOKING, Pose, search_poses
from .shape_fit import LEAST, TRIAL, NoFaceError, fit_shape
from .shape_space import ShapeSpace
from .verdict import judged, likeness_of, misfit_of, weighed

FITTING = "Fitting a face"
TRIAL_MODES = 40
#: Standard deviation of heads' size, as its logarithm, about the likeliest. Of adults it is .026 in one sex (head
#: circumference in ANSUR, Gordon et al. 1989), and women's heads are 4 % smaller than men's; children's are smaller yet. Where
#: a scan shows much of a head this tells little; where a face is cut off all round it keeps size and shape apart.
SIZE = 0.05
TURNS = 3  # times that a fit is begun again


def looked(look: Look, mesh: Mesh, reference: Head, space: ShapeSpace, template, unit_scales, split: float) -> Work:
    """Work returning what one ``look`` sees of the ``template`` (k, 3) mm in a mesh of any of ``unit_scales`` mm per unit: a
    list of `Verdict`, scale, `ShapeFit`, `Surface` and ``space``; ``split`` : fraction of the work at which trials end."""
    samples, few, trials = surface_samples(mesh), space.reduced(TRIAL_MODES), []
    for k, scale in enumerate(unit_scales):
        part = (split * (k + extra) / len(unit_scales) for extra in (0, 1))
        trials += yield from portion(_trials(look, reference, few, mesh, samples, template, scale), *part)
    trials.sort(key=lambda t: t[0])
    good = sum(t[0] < look.worse * trials[0][0] for t in trials[: look.most])
    results = yield from portion(_fits(look, reference, space, few, trials[: look.further], good), split, 1.0)
    return [(*result, space) for result in results]


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
    results, thorough = [], max(look.relief, THOROUGH.relief)
    for k, (_, scale, fit, target) in enumerate(rivals):
        if k >= good and _any_face(results):
            break
        work = fit_shape(space, target, fit.pose, coefficients=fit.coefficients, size=SIZE)
        try:
            fit = yield from run(work, *(0.5 * (k + np.arange(2)) / len(rivals)), FITTING)
        except NoFaceError:
            continue
        relief = look.relief if k < good else thorough
        results.append((judged(reference, space, fit, relief, target), scale, fit, target))
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
                work = fit_shape(few, target, lies(space, fit), TRIAL, every=3, size=SIZE)
                fit = yield from run(work, before, (3 * before + done) / 4, FITTING)
                work = fit_shape(space, target, fit.pose, coefficients=fit.coefficients, size=SIZE)
                fit = yield from run(work, (3 * before + done) / 4, done, FITTING)
            except NoFaceError:
                break
            verdict = judged(reference, space, fit, thorough, target)
            results.append((verdict, scale, fit, target))
            if verdict.likeness < start.likeness + 0.01:
                break
    return results


def _any_face(results):
    """Whether one of ``results`` (`_fits`) is taken for a face."""
    return not all(verdict.doubtful for verdict, *_ in results)


def lies(space, fit) -> Pose:
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
