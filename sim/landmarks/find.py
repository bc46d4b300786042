# SPDX-License-Identifier: GPL-3.0-or-later
"""All 60 landmarks of a scan, found without help: the face, its turn and size, then each by the feature it names."""

from dataclasses import dataclass, replace

import numpy as np

from ..anatomy.head import Head
from ..anatomy.storage import reference_head
from ..blas import on_one_thread
from ..cylindrical.second_opinion import weighed
from ..mesh import Mesh, require_surface
from ..progress import Progress, Work, portion
from ..scan.depth_jumps import depth_jumps
from ..scan.units import USUAL
from .above_beard import without_beards_lead
from .beards import beard_over, is_above_beard
from .confidence import judge, judge_together, sure_as_corners
from .expression import fit_expression, line_of, meeting_lids, outline_of
from .fringe import fit_without_fringe, left_beside
from .glasses import fit_without_glasses, glasses_seen
from .infant import with_mouth_in_place
from .looking import run
from .mouth_beside_hair import with_mouth_again
from .picked import picked
from .placed_face import at_rest, place_face, with_likelier_ears
from .pose_search import LOOKING
from .shape_space import shape_space
from .sure import SURE
from .under_hair import fit_under_hair, hair_over, in_face
from .unseen_jaw import with_unseen_jaw
from .verdict import ODD, judged

#: Landmarks that the shape tells better than the range map.
OWN = set("v op eu g n se ps pi ex ft ac sbal li ch sa sba pa obs".split())
#: Of lips and chin the range map looks where closed lips have them, and parted ones mislead it: where it had these farther than
#: that from the shape, mm on a head of the reference's size, the shape was the nearer one in 13 of 15 cases on 29 scans. So do
#: lips at which the scan ends.
ABOUT_LIPS, ASTRAY = set("ls cph sto sl pg gn".split()), 5.0

UNLIKE = "What was found is unlike most faces: see whether the landmarks lie on one."


@dataclass(frozen=True, eq=False)
class FoundLandmarks:
    """What `find_landmarks` returns.

    positions : name -> (3,) mm in the mesh's own place, all 60 but the ``missing``
    confidence : name -> 0..1
    mid_air : names of those that lie where the scan has a hole; missing : names of those nothing says where they are
    unit_scale : mm per unit of the mesh; bad : how unlike a face that is on which they were found, see `verdict.judged`
    """

    positions: dict[str, np.ndarray]
    confidence: dict[str, float]
    mid_air: tuple[str, ...]
    missing: tuple[str, ...]
    unit_scale: float = 1.0
    bad: float = 0.0

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

    @property
    def doubt(self) -> str:
        """What to say of a find that may be no face; nothing of others."""
        return UNLIKE if self.bad > ODD else ""


def find_landmarks(
    mesh: Mesh, reference: Head | None = None, unit_scales=(1.0,), any_size: bool = False, usual=USUAL
) -> Work:
    """Work returning the `FoundLandmarks` of a cleaned scan, turned any way.

    unit_scales : mm per unit of the mesh, the likeliest of which is found as well
    any_size : whether none of them may be right: if none makes the head a person's, it is brought to the size of most
    usual : mm per unit of the mesh if its file is in a usual unit, in which it may be a body or a room then

    Raises
    ------
    InputError : it is no surface, or there is no face in it.
    """
    return on_one_thread(_finding(mesh, reference, unit_scales, any_size, usual))


def _finding(mesh: Mesh, reference: Head | None, unit_scales, any_size: bool, usual) -> Work:
    """`find_landmarks`."""
    require_surface(mesh)
    yield Progress(0.0, LOOKING)
    reference = reference or reference_head()
    space = shape_space(reference)
    scan = mesh
    jumps = depth_jumps(mesh.vertices, mesh.triangles)
    mesh = Mesh.from_triangles(mesh.vertices, mesh.triangles[~jumps]) if jumps.any() else mesh
    yield Progress(0.05, LOOKING)
    placing = place_face(mesh, reference, space, unit_scales, any_size, usual)
    scale, fit, target, space = yield from portion(placing, 0.05, 0.73)
    fit = yield from portion(at_rest(reference, space, target, fit), 0.73, 0.75)
    fit = yield from portion(with_likelier_ears(space, target, fit), 0.75, 0.77)
    beard, above = None, is_above_beard(space)
    space = shape_space(reference) if above else space
    if not space.of_infants:
        fit, beard = yield from portion(without_beards_lead(reference, space, target, fit, above), 0.77, 0.79)
        target = target.without(beard_over(space, beard, target))
    haired, fringe = target, np.zeros(len(space.points), dtype=bool)
    if not space.of_infants:
        fit, fringe = yield from run(fit_without_fringe(space, target, fit), 0.79, 0.795, "Looking for hair")
    under = hair_over(space, fit, target, fringe)
    target = target.without(under)
    fit, telling = yield from run(fit_without_glasses(space, target, fit), 0.795, 0.8, "Looking for glasses")
    worn = glasses_seen(space, telling, target)
    target = target.without(worn)
    haired = left_beside(haired, under, worn) if under.any() else target
    scan = scan.moved(scan.vertices * scale)
    whole = space
    if beard is None:
        fit, space = yield from run(with_unseen_jaw(space, target, fit), 0.8, 0.81, "Looking for the mouth")
    if space.of_infants:
        fit = yield from run(with_mouth_in_place(space, target, fit), 0.81, 0.82, "Looking for the mouth")
    bad = judged(reference, space, fit, 0.0).bad
    fit, shown = yield from run(fit_expression(space, target, fit, scan), 0.82, 0.88, "Looking at lips and lids")
    hair = yield from run(fit_under_hair(space, haired, fit, shown, fringe=fringe), 0.88, 0.89, "Looking for hair")
    again = yield from run(with_mouth_again(space, target, hair, shown), 0.89, 0.895, "Looking for the mouth")
    if again is not None:
        hair = yield from run(
            fit_under_hair(space, haired, again, shown, fringe=fringe), 0.895, 0.9, "Looking for hair"
        )
    fit = hair.fit
    positions = picked(space, fit, target)
    confidence, mid_air, missing = judge(space, fit, target, positions)
    skull = picked(space, hair.scalp, target)
    positions |= {n: p for n, p in skull.items() if hair.told_by_scalp(n, n in mid_air)}
    positions = {n: p for n, p in positions.items() if n not in missing}
    confidence = {n: confidence[n] for n in positions}
    bare = target.without(hair_over(space, fit, target, hair.covered & ~in_face(space, fit, {}, 0.0)))
    seen = Mesh.from_triangles(bare.vertices, bare.triangles)
    other = yield from portion(weighed(seen, positions, confidence, reference, bare), 0.9, 1.0)
    if telling or beard or fringe.any():
        # Over holes as wide as those a relaxed map tells less than the shape, over others as much.
        other |= {n: positions[n] for n in mid_air}
    positions = better_of(positions, other, shown.parted or space is not whole, fit.pose.scale)
    lids = meeting_lids(space, fit, target, shown.shut) | shown.lids
    lids = {n: p for n, p in lids.items() if n in positions}
    positions |= lids
    mid_air = tuple(n for n in mid_air if n not in lids)
    confidence |= {n: max(confidence[n], sure_as_corners(confidence, n)) for n in lids}
    mouth = (outline_of if shown.parted else line_of)(space, fit, target)
    if mouth is not None:
        positions |= {n: p for n, p in mouth.marks.items() if n in positions}
        mid_air += ("sto",) if shown.parted and "sto" in positions and "sto" not in mid_air else ()
    rest = reference.landmark_positions()
    confidence = judge_together(positions, confidence, mid_air, rest, shown, hair.hidden)
    return FoundLandmarks(positions, confidence, mid_air, missing, scale, bad)


def better_of(shape, by_map, misled: bool, scale: float) -> dict[str, np.ndarray]:
    """Name -> (3,) mm: each landmark where the ``shape`` has it or where the range map does, ``by_map``, both such tables.

    misled : whether the lips are parted, or the scan ends at them; scale : mm on the scan per mm of the reference
    """
    out = {}
    for name, place in shape.items():
        base = name.partition("_")[0]
        astray = misled and base in ABOUT_LIPS and np.linalg.norm(by_map[name] - place) > ASTRAY * scale
        out[name] = place if astray or base in OWN else by_map[name]
    return out
