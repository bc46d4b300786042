# SPDX-License-Identifier: GPL-3.0-or-later
"""A first look at a scan with the landmarks given: a plausible head laid on it tells what they do not.

Where lids are, what hangs out of the mouth and is no skin, what are glasses, and what is hair, of the head or a beard.
"""

from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np

from ..adapt.closest import Surface
from ..adapt.ears import EAR_MARKS
from ..adapt.scan_surface import NO_SKIN
from ..adapt.skin_fit import SkinFit
from ..adapt.thin_plate_spline import similarity
from ..anatomy.head import Head
from ..mesh import Mesh
from ..progress import Work, portion
from ..relax.mouth_gap import MARKS
from .above_beard import without_beards_lead
from .beards import OVER_SKIN, beard_over, picked_on
from .confidence import in_mid_air
from .expression import fit_expression
from .fringe import fit_without_fringe, left_beside
from .glasses import BEFORE_SKIN, fit_without_glasses, glasses_seen
from .hair_rim import rim_of_hair
from .held_by_lips import held_by_lips
from .hidden_skin import COVERED, EARLESS, TOLD, UNSEEN, hidden_skin, unseen_face, unseen_scalp, with_hidden_skin
from .infant import likelier_space, with_mouth_in_place
from .lids_told import lids_told
from .looking import facing_out, run
from .picked import moved, picked
from .pose_search import Pose
from .shape_fit import NoFaceError, Told, fit_shape
from .shape_space import shape_space
from .under_hair import EAR, SKULL, fit_under_hair, hair_over, in_face, scalp_by_face
from .unseen_jaw import JAW, unseen_jaw, with_unseen_jaw

LOOKING = "Looking at lids and lips"
#: Landmarks about which skin is much the same, so that a plausible head does not tell where they are.
UNTOLD = ("tr", "eu")
BESIDE_FACE = 11.0  # mm from the face's outline: what lies within and may be skin is as scanned
KINDS = ("held_by_lips", "hair", "glasses", "beard")  # of `NO_SKIN`, those that a face tells
FEWEST = 4  # landmarks that tell where the head is


@dataclass(frozen=True, eq=False)
class FirstLook:
    """landmarks : name -> (3,) mm, those given, without those on a beard or a fringe, and those of lids that are seen; lips :
    about where their landmarks are if they are parted, if only a little, or None; target : the scan without what the lips
    hold, hair, glasses and beards; left_out : how much of it that is, mm²; filled : with skin behind it, and where it lacks
    the scalp, as that probably is; hidden (k,) : vertices of the reference's skin that make that up; guessed : name -> (3,)
    mm, about where others are; laid : the same of those given that the face tells, where it has them itself."""

    landmarks: dict[str, np.ndarray]
    target: Surface
    filled: Surface
    lips: dict[str, np.ndarray] | None = None
    left_out: dict[str, float] = field(default_factory=lambda: dict.fromkeys(KINDS, 0.0))
    hidden: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    guessed: dict[str, np.ndarray] = field(default_factory=dict)
    laid: dict[str, np.ndarray] = field(default_factory=dict)

    def seen_only(self, fit: SkinFit) -> SkinFit:
        """A ``fit`` to the ``filled`` scan, as one to what the scan shows."""
        if fit.target is not self.filled or len(self.hidden) == 0:
            return fit
        fitted, distance = fit.fitted.fitted.copy(), fit.fitted.distance.copy()
        fitted[self.hidden], distance[self.hidden] = 0, np.nan
        return replace(fit, target=self.target, fitted=replace(fit.fitted, fitted=fitted, distance=distance))


def first_look(
    reference: Head,
    target: Surface,
    given: dict[str, np.ndarray],
    leave_out: Collection[str] = NO_SKIN,
    found: Collection[str] = (),
    scan: Mesh | None = None,
) -> Work:
    """Work returning the `FirstLook` at the scan ``target`` with the landmarks ``given`` (name -> (3,) mm).

    leave_out : of `NO_SKIN`; what the lips hold, glasses, hair, or a beard, is taken for skin where it is not among them
    found : names of those given that nobody picked: in mid-air they are guesses, and of an infant they tell nothing
    scan : its vertices, mm, and their colours, which tell whether eyes are open
    """
    rest = reference.landmark_positions()
    names = [name for name in given if name in rest]
    if len(names) < FEWEST:
        return FirstLook(given, target, target)
    space = shape_space(reference)
    matrix, shift = similarity([rest[name] for name in names], [given[name] for name in names])
    scale = np.cbrt(np.linalg.det(matrix))
    pose, told = Pose(scale, matrix / scale, shift, 0.0), None
    clear = {n: given[n] for n in names if n.partition("_")[0] not in (*UNTOLD, *SKULL)}
    space = likelier_space(reference, space, pose.scale, clear)
    if space.of_infants:
        told = _told_of(space, pose, {n: p for n, p in clear.items() if n not in found})
    target = whole = facing_out(space, target, pose)
    coarse, jaw_told = target.coarser(), any(name in given for name in JAW)
    try:
        fit = yield from run(fit_shape(space, coarse, pose, told=told), 0.0, 0.5, LOOKING)
        beard = telling = None
        if "beard" in leave_out and not space.of_infants:
            work = without_beards_lead(reference, space, coarse, fit, rough=True)
            fit, beard = yield from portion(work, 0.5, 0.53)
        grown = beard_over(space, beard, target)
        bearded, beard_area = target.vertices[target.triangles[grown].ravel()], target.area[grown].sum()
        if grown.any():
            on_beard, target = target.without(~grown), target.without(grown)
            coarse = target.coarser()
        whole_hair, fringe = target, np.zeros(len(space.points), dtype=bool)
        if "hair" in leave_out and not space.of_infants:
            fit, fringe = yield from run(fit_without_fringe(space, coarse, fit), 0.53, 0.54, LOOKING)
        fallen = hair_over(space, fit, target, fringe)
        fallen_area = target.area[fallen].sum()
        if fallen.any():
            target = target.without(fallen)
            coarse = target.coarser()
        if "glasses" in leave_out:
            fit, telling = yield from run(fit_without_glasses(space, coarse, fit), 0.54, 0.55, LOOKING)
        worn = glasses_seen(space, telling, target)
        glasses, glasses_area = target.vertices[target.triangles[worn].ravel()], target.area[worn].sum()
        if worn.any():
            target = target.without(worn)
            coarse = target.coarser()
        haired = left_beside(whole_hair, fallen, worn).coarser() if fallen.any() else coarse
        if not jaw_told and beard is None:
            fit, space = yield from run(with_unseen_jaw(space, coarse, fit), 0.55, 0.58, LOOKING)
        if space.of_infants:
            fit = yield from run(with_mouth_in_place(space, coarse, fit), 0.58, 0.6, LOOKING)
        fit, shown = yield from run(fit_expression(space, coarse, fit, scan), 0.6, 0.9, LOOKING)
        skull = [n for n in names if n.partition("_")[0] in SKULL and n not in found]
        off = in_mid_air(target, np.reshape([given[n] for n in skull], (-1, 3)))
        known = {n: given[n] for n in np.array(skull)[off]}
        hair = yield from run(fit_under_hair(space, haired, fit, shown, given, known, fringe), 0.9, 1.0, LOOKING)
    except NoFaceError:
        return FirstLook(given, whole, whole)
    landmarks = given | lids_told(space, fit, shown, coarse, given)
    laid = space.landmarks(fit.points)
    lips = {name: laid[name] for name in MARKS} if shown.parted else None
    untold = (*UNTOLD, "sto") if shown.parted else UNTOLD
    places, laid = picked(space, hair.fit, coarse), space.landmarks(hair.fit.points)
    laid |= {n: p for n, p in places.items() if n.partition("_")[0] in EAR_MARKS}
    laid |= {n: p for n, p in space.landmarks(hair.scalp.points).items() if hair.told_by_scalp(n)}
    guessed = {n: p for n, p in laid.items() if n not in landmarks and n.partition("_")[0] not in untold}
    held, covered = (np.zeros(len(each), dtype=bool) for each in (target.triangles, space.points))
    kept = "hair" not in leave_out and hair.covered.any()
    if "held_by_lips" in leave_out:
        held = held_by_lips(space, fit, target)
    if "hair" in leave_out:
        covered |= hair.covered & ~in_face(space, hair.fit, given, BESIDE_FACE)
        covered |= hair.far & ~in_face(space, hair.fit, given, 0.0)
    covered &= ~fringe
    shows = hair_over(space, hair.fit, target, covered)
    if "hair" in leave_out:
        probably = covered | hair.covered
        rising, rim = rim_of_hair(space, hair.scalp, target, probably, covered, fringe | (space.ear > EARLESS), given)
        shows |= rising
        covered |= rim
    left = target.without(held | shows)
    hidden = hidden_skin(space, fit, target.vertices[target.triangles[held].ravel()], left)
    hidden |= hidden_skin(space, fit, glasses, left, BEFORE_SKIN)
    under = hidden_skin(space, fit, bearded, left, OVER_SKIN)
    if not jaw_told and beard is None:
        hidden |= unseen_jaw(space, fit, left)
    picks = np.reshape([given[n] for n in names if n not in found], (-1, 3))
    hidden |= unseen_face(space, fit, left, picks[in_mid_air(left, picks)])
    filled = with_hidden_skin(space, fit, hidden & ~under, left)
    below = {n for n, corners in zip(space.names, space.corners, strict=True) if under[corners].all()}
    misled = picked_on(space, fit, on_beard, {n: clear[n] for n in clear if n in below}) if grown.any() else set()
    chin = {n: given[n] - fit.matrix @ moved(n) for n in clear if n in below and n not in (*found, *misled)}
    filled = with_hidden_skin(space, fit, under, filled, TOLD if chin else COVERED, chin)
    hidden |= under
    no_ear = space.ear < EAR  # ears take the reference's shape
    if fallen.any():
        hair_alone = whole_hair.without(~fallen)
        forehead = fringe & no_ear & hidden_skin(space, hair.scalp, hair_alone.vertices, left, OVER_SKIN)
        filled = with_hidden_skin(space, hair.scalp, forehead, filled)
        hidden |= forehead
        fringed = {n for n, corners in zip(space.names, space.corners, strict=True) if fringe[corners].any()}
        misled |= picked_on(space, hair.scalp, hair_alone, {n: given[n] for n in names if n in fringed})
    filled = with_hidden_skin(space, scalp_by_face(space, hair, covered, given), covered & no_ear, filled)
    unseen = unseen_scalp(space, hair.scalp, left) & ~covered & (not kept)  # what lies far below hair is not unseen
    filled = with_hidden_skin(space, hair.scalp, unseen & no_ear, filled, UNSEEN)
    areas = (target.area[held].sum(), target.area[shows].sum() + fallen_area, glasses_area, beard_area)
    out = dict(zip(KINDS, map(float, areas), strict=True))
    own = {n: places[n] for n in clear if n in places}
    landmarks = {n: p for n, p in landmarks.items() if n not in misled}
    guessed |= {n: laid[n] for n in misled}
    return FirstLook(landmarks, left, filled, lips, out, space.vertices[hidden | covered | unseen], guessed, own)


def _told_of(space, pose, marks):
    """What the ``marks`` that somebody picked tell of an infant's face at ``pose``; None: there are none.

    An infant's face may differ by much from the likeliest, and a fit without them lays its ears amiss. On grown faces they
    changed next to nothing.
    """
    return Told.of(space, {n: p - pose.scale * pose.turn @ moved(n) for n, p in marks.items()}) if marks else None
