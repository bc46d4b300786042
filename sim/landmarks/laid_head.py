# SPDX-License-Identifier: GPL-3.0-or-later
"""A plausible head laid on a scan with the landmarks given, and what of the scan lies over its skin.

Beards, fringes and glasses are told one after the other, each by a head laid without what was told before: what is left of
the scan tells the face, its expression, and last of all what is under hair.
"""

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np

from ..adapt.closest import Surface
from ..anatomy.head import Head
from ..mesh import Mesh
from ..progress import Work, portion
from .above_beard import without_beards_lead
from .beards import beard_over
from .clothing import clothing_over
from .confidence import in_mid_air
from .expression import fit_expression
from .fringe import fit_without_fringe, left_beside
from .glasses import fit_without_glasses, glasses_seen
from .infant import with_mouth_in_place
from .looking import run
from .pose_search import Pose
from .shape_fit import Expression, ShapeFit, Told, fit_shape
from .shape_space import ShapeSpace
from .under_hair import SKULL, UnderHair, fit_under_hair, hair_over
from .unseen_jaw import JAW, with_unseen_jaw

LOOKING = "Looking at lids and lips"


@dataclass(frozen=True, eq=False)
class LaidHead:
    """space : shapes of such heads; fit : one laid on the scan, with the expression ``shown``; hair : what is under hair;
    target : the scan without ``beard``, ``fringe``, ``glasses`` and ``clothing``, which lie over its skin (without triangles
    where there is none); coarse : the target with fewer triangles; fringed (n,) bool : the points of the skin under the fringe;
    ends_at_jaw : whether the scan may end above the chin, for all that landmarks and a beard tell."""

    space: ShapeSpace
    fit: ShapeFit
    shown: Expression
    hair: UnderHair
    target: Surface
    coarse: Surface
    beard: Surface
    fringe: Surface
    glasses: Surface
    clothing: Surface
    fringed: np.ndarray
    ends_at_jaw: bool


@dataclass
class _Scan:
    """What is left of a scan, and the same with fewer triangles, as one thing after the other is taken off it."""

    target: Surface
    coarse: Surface = field(init=False)

    def __post_init__(self):
        self.coarse = self.target.coarser()

    def take(self, triangles: np.ndarray) -> Surface:
        """Leave out ``triangles`` (m,) bool; returns what they make up."""
        if not triangles.any():
            return Surface(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))
        taken, self.target = self.target.without(~triangles), self.target.without(triangles)
        self.coarse = self.target.coarser()
        return taken


def lay_head(
    reference: Head,
    space: ShapeSpace,
    target: Surface,
    pose: Pose,
    given: dict[str, np.ndarray],
    leave_out: Collection[str],
    found: Collection[str],
    scan: Mesh | None,
    told: Told | None,
) -> Work:
    """Work returning a `LaidHead` on the scan ``target``, about at ``pose``.

    given : name -> (3,) mm, landmarks of the reference's; ``found`` : names of those that nobody picked; leave_out : of
    `NO_SKIN`, what is told; scan : the target's vertices, mm, and their colours; told : places that the first fit keeps to

    Raises
    ------
    NoFaceError : too little of a face is left.
    """
    left, grown_up = _Scan(target), not space.of_infants
    fit = yield from run(fit_shape(space, left.coarse, pose, told=told), 0.0, 0.5, LOOKING)
    beard = telling = None
    if "beard" in leave_out and grown_up:
        work = without_beards_lead(reference, space, left.coarse, fit, rough=True)
        fit, beard = yield from portion(work, 0.5, 0.53)
    on_beard = left.take(beard_over(space, beard, left.target))
    bearded, fringed = left.target, np.zeros(len(space.points), dtype=bool)
    if "hair" in leave_out and grown_up:
        fit, fringed = yield from run(fit_without_fringe(space, left.coarse, fit), 0.53, 0.54, LOOKING)
    fallen = hair_over(space, fit, left.target, fringed)
    fringe = left.take(fallen)
    if "glasses" in leave_out:
        fit, telling = yield from run(fit_without_glasses(space, left.coarse, fit), 0.54, 0.55, LOOKING)
    worn = glasses_seen(space, telling, left.target)
    glasses = left.take(worn)
    haired = left_beside(bearded, fallen, worn).coarser() if fallen.any() else left.coarse
    ends_at_jaw = beard is None and not any(name in given for name in JAW)
    if ends_at_jaw:
        fit, space = yield from run(with_unseen_jaw(space, left.coarse, fit), 0.55, 0.58, LOOKING)
    if space.of_infants:
        fit = yield from run(with_mouth_in_place(space, left.coarse, fit), 0.58, 0.6, LOOKING)
    fit, shown = yield from run(fit_expression(space, left.coarse, fit, scan), 0.6, 0.9, LOOKING)
    clothing = left.take(clothing_over(space, fit, left.target, scan if "clothing" in leave_out else None))
    skull = [n for n in given if n.partition("_")[0] in SKULL and n in space.names and n not in found]
    off = in_mid_air(left.target, np.reshape([given[n] for n in skull], (-1, 3)))
    known = {n: given[n] for n in np.array(skull)[off]}
    hair = yield from run(fit_under_hair(space, haired, fit, shown, given, known, fringed), 0.9, 1.0, LOOKING)
    return LaidHead(
        space, fit, shown, hair, left.target, left.coarse, on_beard, fringe, glasses, clothing, fringed, ends_at_jaw
    )
