# SPDX-License-Identifier: GPL-3.0-or-later
"""A first look at a scan with the landmarks given: a plausible head laid on it tells what they do not.

Where lids are, what hangs out of the mouth and is no skin, what are glasses, and what is hair, of the head or a beard
(`laid_head`, `skin_left`); skin that those hide is filled in (`filled_in`).
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
from ..progress import Work
from ..relax.mouth_gap import MARKS
from .clothing import under_clothing
from .filled_in import filled_in
from .infant import likelier_space
from .laid_head import LaidHead, lay_head
from .lids_told import lids_told
from .looking import facing_out
from .picked import moved, picked
from .pose_search import Pose
from .shape_fit import NoFaceError, Told
from .shape_space import shape_space
from .skin_left import skin_left
from .under_hair import SKULL

#: Landmarks about which skin is much the same, so that a plausible head does not tell where they are.
UNTOLD = ("tr", "eu")
KINDS = ("held_by_lips", "hair", "glasses", "beard", "clothing")  # of `NO_SKIN`, those that a face tells
FEWEST = 4  # landmarks that tell where the head is


@dataclass(frozen=True, eq=False)
class FirstLook:
    """landmarks : name -> (3,) mm, those given, without those on a beard or a fringe, and those of lids that are seen; lips :
    about where their landmarks are if they are parted, if only a little, or None; target : the scan without what the lips
    hold, hair, glasses, beards and clothing; left_out : how much of it that is, mm²; filled : with skin behind it, and where it
    lacks the scalp, as that probably is; hidden (k,) : vertices of the reference's skin that make that up; clothed (k,) : those
    under clothing, which is not filled; guessed : name -> (3,)
    mm, about where others are; laid : the same of those given that the face tells, where it has them itself."""

    landmarks: dict[str, np.ndarray]
    target: Surface
    filled: Surface
    lips: dict[str, np.ndarray] | None = None
    left_out: dict[str, float] = field(default_factory=lambda: dict.fromkeys(KINDS, 0.0))
    hidden: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    clothed: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
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

    leave_out : of `NO_SKIN`; what the lips hold, glasses, hair, beards and clothing are taken for skin if not among them
    found : names of those given that nobody picked: in mid-air they are guesses, and of an infant they tell nothing
    scan : its vertices, mm, and their colours, which tell whether eyes are open, and clothing
    """
    rest = reference.landmark_positions()
    names = [name for name in given if name in rest]
    if len(names) < FEWEST:
        return FirstLook(given, target, target)
    space = shape_space(reference)
    matrix, shift = similarity([rest[name] for name in names], [given[name] for name in names])
    scale = np.cbrt(np.linalg.det(matrix))
    pose, told = Pose(scale, matrix / scale, shift, 0.0), None
    known = {n: given[n] for n in names}
    clear = {n: p for n, p in known.items() if n.partition("_")[0] not in (*UNTOLD, *SKULL)}
    space = likelier_space(reference, space, pose.scale, clear)
    if space.of_infants:
        told = _told_of(space, pose, {n: p for n, p in clear.items() if n not in found})
    target = facing_out(space, target, pose)
    try:
        head = yield from lay_head(reference, space, target, pose, known, leave_out, found, scan, told)
    except NoFaceError:
        return FirstLook(given, target, target)
    landmarks = given | lids_told(head.space, head.fit, head.shown, head.coarse, given)
    places, laid, lips = _landmarks_of(head)
    untold = UNTOLD if lips is None else (*UNTOLD, "sto")
    guessed = {n: p for n, p in laid.items() if n not in landmarks and n.partition("_")[0] not in untold}
    left = skin_left(head, given, leave_out)
    filled = filled_in(head, left, known, clear, found, leave_out)
    things = head.fringe, head.glasses, head.beard, head.clothing
    fringe, *others = (float(thing.area.sum()) for thing in things)
    out = dict(zip(KINDS, (left.held_area, left.hair_area + fringe, *others), strict=True))
    landmarks = {n: p for n, p in landmarks.items() if n not in filled.misled}
    guessed |= {n: laid[n] for n in filled.misled}
    own = {n: places[n] for n in clear if n in places}
    hidden, clothed = (head.space.vertices[points] for points in (filled.hidden, under_clothing(head, left.surface)))
    return FirstLook(landmarks, left.surface, filled.surface, lips, out, hidden, clothed, guessed, own)


def _landmarks_of(head: LaidHead):
    """Landmarks, name -> (3,) mm: those that the face tells, where it has them itself; all, about where they are; and those of
    lips, None if they are not parted."""
    space, hair = head.space, head.hair
    as_shown, laid = space.landmarks(head.fit.points), space.landmarks(hair.fit.points)
    places = picked(space, hair.fit, head.coarse)
    laid |= {n: p for n, p in places.items() if n.partition("_")[0] in EAR_MARKS}
    laid |= {n: p for n, p in space.landmarks(hair.scalp.points).items() if hair.told_by_scalp(n)}
    return places, laid, {name: as_shown[name] for name in MARKS} if head.shown.parted else None


def _told_of(space, pose, marks):
    """What the ``marks`` that somebody picked tell of an infant's face at ``pose``; None: there are none.

    An infant's face may differ by much from the likeliest, and a fit without them lays its ears amiss. On grown faces they
    changed next to nothing.
    """
    return Told.of(space, {n: p - pose.scale * pose.turn @ moved(n) for n, p in marks.items()}) if marks else None
