# SPDX-License-Identifier: GPL-3.0-or-later
"""All 60 landmarks of a scan, found without help: the face, its turn and size, then each by the feature it names."""

from dataclasses import dataclass, replace

import numpy as np

from ..adapt.closest import Surface
from ..adapt.relief import face_likeness
from ..adapt.scan_surface import NORMALS
from ..anatomy.head import Head
from ..anatomy.storage import load_head
from ..cylindrical.second_opinion import weighed
from ..errors import InputError
from ..mesh import Mesh, vertex_normals
from ..progress import Progress, Work, portion
from ..scan.face_match import face_template, surface_samples
from .confidence import judge, judge_together, sure_as_corners
from .expression import fit_expression, meeting_lids
from .picked import picked
from .pose_search import LOOKING, search_poses
from .shape_fit import TRIAL, NoFaceError, fit_shape
from .shape_space import shape_space
from .sure import SURE

NO_FACE = (
    "No face is found in the scan: check that it shows one, or give landmarks with --landmarks or by clicking them."
)
#: Landmarks that the shape tells better than the range map.
OWN = set("v op eu g n se ps pi ex ft ac sbal li ch sa sba pa obs".split())
TRIED = 10  # placements that are looked at closely
RIVAL, RIVALS = 1.25, 3  # placements that fit this much worse at first may be right: so many are followed
TRIAL_MODES = 40
RELIEF = 0.53  # correlation with the relief of a face: faces have 0.67 and more, balls, boxes and backs of heads 0.4
POOR = 2.6  # mm on a head of the reference's size: a mean distance in the face above which there is none


@dataclass(frozen=True, eq=False)
class FoundLandmarks:
    """What `find_landmarks` returns.

    positions : name -> (3,) mm in the mesh's own place, all 60 but the ``missing``
    confidence : name -> 0..1
    mid_air : names of those that lie where the scan has a hole; missing : names of those nothing says where they are
    unit_scale : mm per unit of the mesh; misfit : mean distance of a face to the scan, mm
    """

    positions: dict[str, np.ndarray]
    confidence: dict[str, float]
    mid_air: tuple[str, ...]
    missing: tuple[str, ...]
    unit_scale: float = 1.0
    misfit: float = 0.0

    def placed(self, positions: dict[str, np.ndarray]) -> "FoundLandmarks":
        """The same landmarks with other ``positions``."""
        return replace(self, positions=positions)

    def sure(self) -> dict[str, np.ndarray]:
        """Those to build a head from: name -> (3,) mm of all that the scan shows clearly enough."""
        return {n: p for n, p in self.positions.items() if n not in self.mid_air and self.confidence[n] >= SURE}

    def summary(self) -> str:
        """A few words for the user."""
        words = f"{len(self.positions) - len(self.mid_air)} landmarks found"
        words += f", {len(self.mid_air)} in mid-air over holes" if self.mid_air else ""
        return words + (f", {len(self.missing)} missing" if self.missing else "")


def find_landmarks(mesh: Mesh, reference: Head | None = None, unit_scales=(1.0,)) -> Work:
    """Work returning the `FoundLandmarks` of a cleaned scan, turned any way.

    unit_scales : mm per unit of the mesh, the likeliest of which is found as well

    Raises
    ------
    InputError : there is no face in it.
    """
    yield Progress(0.0, LOOKING)
    reference = reference or load_head()
    space = shape_space(reference)
    few = space.reduced(TRIAL_MODES)
    yield Progress(0.05, LOOKING)
    template, samples = face_template(reference), surface_samples(mesh)
    trials = []
    for k, scale in enumerate(unit_scales):
        low, middle, high = (0.1 + 0.4 * (k + part) / len(unit_scales) for part in (0.0, 0.5, 1.0))
        poses = yield from portion(search_poses(samples * scale, template, TRIED), low, middle)
        yield Progress(middle, LOOKING)
        target = Surface(mesh.vertices * scale, mesh.triangles, smooth=NORMALS).coarser()
        for number, pose in enumerate(poses):
            facing = _facing(few, target, pose)
            part = (middle + (high - middle) * (number + extra) / len(poses) for extra in (0, 1))
            try:
                fit = yield from _run(fit_shape(few, facing, pose, TRIAL, every=3), *part, LOOKING)
            except NoFaceError:
                continue
            trials.append((_misfit(few, fit), scale, fit, facing))
    if not trials:
        raise InputError(NO_FACE)
    trials.sort(key=lambda t: t[0])
    rivals = [t for t in trials if t[0] < RIVAL * trials[0][0]][:RIVALS]
    results = []
    for k, (_, scale, fit, target) in enumerate(rivals):
        low, high = 0.5 + 0.3 * k / len(rivals), 0.5 + 0.3 * (k + 1) / len(rivals)
        work = fit_shape(space, target, fit.pose, coefficients=fit.coefficients)
        try:
            fit = yield from _run(work, low, high, "Fitting a face")
        except NoFaceError:
            continue
        misfit, likeness = _misfit(space, fit), _likeness(reference, space, fit)
        if misfit <= POOR and likeness >= RELIEF:
            results.append((misfit / likeness, misfit, scale, fit, target))
    if not results:
        raise InputError(NO_FACE)
    _, misfit, scale, fit, target = min(results, key=lambda t: t[0])
    fit, shown = yield from _run(fit_expression(space, target, fit), 0.8, 0.9, "Looking at lips and lids")
    positions = picked(space, fit, target)
    confidence, mid_air, missing = judge(space, fit, target, positions)
    positions = {n: p for n, p in positions.items() if n not in missing}
    confidence = {n: confidence[n] for n in positions}
    seen = Mesh.from_triangles(target.vertices, target.triangles)
    other = yield from portion(weighed(seen, positions, confidence, reference, target), 0.9, 1.0)
    positions = {n: p if n.partition("_")[0] in OWN else other[n] for n, p in positions.items()}
    met = {n: p for n, p in meeting_lids(space, fit, target, shown.shut).items() if n in positions}
    positions |= met
    mid_air = tuple(n for n in mid_air if n not in met)
    confidence |= {n: max(confidence[n], sure_as_corners(confidence, n)) for n in met}
    confidence = judge_together(positions, confidence, mid_air, reference.landmark_positions(), shown.shut)
    return FoundLandmarks(positions, confidence, mid_air, missing, scale, misfit)


def _facing(space, target, pose):
    """The scan turned inside out if its normals face away from those of a skin at ``pose``."""
    points = pose.scale * space.points @ pose.turn.T + pose.shift
    face = space.face > 0.5
    found = target.closest(points[face], 15.0)
    agree = np.einsum("ij,ij->i", found.normals, vertex_normals(points, space.triangles)[face])[found.found]
    return target.turned() if len(agree) and np.median(agree) < 0 else target


def _likeness(reference, space, fit):
    """How much relief of a face the scan has where the skin was laid on it, see `adapt.likeness`."""
    skin = reference.skin.vertices @ fit.matrix.T + fit.pose.shift
    fitted = np.zeros(len(skin))
    skin[space.vertices], fitted[space.vertices] = fit.points, fit.trust
    return face_likeness(reference, skin, fitted)


def _misfit(space, fit):
    """Mean distance of the face to the scan, mm; what found nothing counts as far."""
    weight = space.area * (space.face > 0.5)
    distance = np.where(np.isfinite(fit.distance), np.abs(fit.distance), 6.0)
    return float(np.average(distance, weights=weight)) / fit.pose.scale


def _run(work, start, stop, label):
    while True:
        try:
            done = next(work)
        except StopIteration as end:
            return end.value
        yield Progress(start + (stop - start) * done, label)
