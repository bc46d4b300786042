# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair of the head: a scanner sees it as a rough surface off the scalp, and it is no skin.

Where hair can grow, hair is what is rougher than skin, and than the same scan's forehead: its normals vary against those of
a plausible head laid on the scan (`shape_fit`), and its height does by more than noise. So is what stands off that head as
far as no skull does. If hair hides an ear, it hides what lies about that ear as well, outside of the face. Laid on the scan
again, in the knowledge of what is hair, that head tells where the scalp probably lies below.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from ..adapt.closest import Surface
from ..adapt.ears import EAR_MARKS
from ..adapt.scan_surface import cuts_of
from ..mesh import vertex_normals
from ..scan.flat_cuts import beyond
from .confidence import LIKE_AN_EAR, like_ears
from .shape_fit import CHANGE, STANDS_OFF, Expression, ShapeFit, Told, fit_shape, part_of
from .shape_space import ShapeSpace

MANY = 24_000  # triangles of the scan that tell
AROUND = 14.0  # mm about such a place in which a scan is rough or not
MOSTLY = 9.0  # mm about a point of the skin in which it is hair for the most part
EAR = 0.3  # of `ShapeSpace.ear` from which on skin is an ear
FROM_EAR = 12.0  # mm: nearer than this to an ear its folds are rough
#: rad by which normals vary, and that in terms of the forehead's.
ROUGH, ROUGHER = 0.14, 1.5
#: mm by which heights vary at least: .26 where dark skin was scanned with noise, 1 to 2 over hair (medians).
UNEVEN = 0.5
HIGH = 8.0  # mm by which no skull stands off the head laid on it
SMOOTH = 25  # per cent of a forehead that are smoother than skin is: hair falls on the rest of some
LEAST = 0.15  # share of all hairy skin: fewer specks are no hair
NEAR_EAR = 8.0  # mm from an ear that is guessed to one that is seen
#: Share of an ear by which the scan lies, if it is seen: .98 and more of ten ears beside hair; of six under it .94, five less
#: than .67. Beside an ear under hair, another such had .89.
FOUND, BESIDE_HIDDEN = 0.85, 0.92
WITH_EARS = 60.0  # mm about an ear under hair that is under hair as well, outside of the face
#: mm from the face to where it hardly tells of skin under hair beside it any more, if ears do not. What a scan shows of skin
#: next to hair is followed so: .67 mm off without that on one with landmarks, .51 with it (95th percentile). What lies under
#: hair is not told better: the edges of two faces under long hair were 1.2 and .7 mm off without, 1.5 and 1.1 with it.
BY_FACE = 30.0
EDGE = -1.0  # mm from the outline of a face that is read from hair beside it, within which it is face
INNER = -20.0  # mm from that outline within which no hair led the fit astray
OFF = 4.0  # mm by which hair stands off there
#: Rounds of a fit that tells of the scalp, as in `shape_fit.SCHEDULE`. What a face has of its own to a millimetre tells nothing
#: of the skull behind, and a fit that explains it bends that: given the faces of seven heads and a mannequin, such a fit was
#: 14.1 mm off their skulls (95th percentile), this one is 7.4; given nine faces of ICT-FaceKit, 9.1 and 9.7. Under hair of 5 to
#: 28 mm made for 14 people of it, this one is 1.7 mm off their scalps on average, such a fit 4.9.
LOOSE = ((1.0, 8.0, 2.5, 4.5),) * 6
#: How much skin that expressions move tells of the skull behind a face whose lips are parted. Six smiles of ICT-FaceKit were
#: 12.8 mm off their unseen skulls with all of it (95th percentile), 11.0 with so little.
HARDLY = 0.02

#: Landmarks that such a fit tells where they are not seen.
SKULL = ("v", "op", "eu")


@dataclass(frozen=True, eq=False)
class UnderHair:
    """fit : the `ShapeFit` of a head to a scan of which it is known what is hair; scalp : a looser one, that tells where scalp
    is that is not seen; covered (n,) bool : the points of its skin over which hair is; far (n,) bool : those from which it
    stands off as no skin does; hidden : the sides of ears that are not seen."""

    fit: ShapeFit
    scalp: ShapeFit
    covered: np.ndarray
    far: np.ndarray
    hidden: tuple[str, ...]

    @property
    def earless(self) -> bool:
        """Whether neither ear is seen."""
        return len(self.hidden) == 2

    def told_by_scalp(self, name: str, unseen: bool = True) -> bool:
        """Whether the ``scalp`` has the landmark ``name``, rather than the closer ``fit``: those of the skull if they are
        ``unseen``, and those of ears where neither tells of the other."""
        base = name.partition("_")[0]
        return (unseen and base in SKULL) or (self.earless and base in EAR_MARKS)


def fit_under_hair(
    space: ShapeSpace,
    target: Surface,
    fit: ShapeFit,
    shown: Expression,
    given: Collection[str] = (),
    skull: dict[str, np.ndarray] | None = None,
    fringe=None,
):
    """A generator: yields the fraction done, returns `UnderHair` of a ``fit`` to the scan ``target``.

    shown : the expression of ``fit``; given : names of landmarks that are known: an ear that has any is no hair; skull : name
    -> (3,) mm, those of `SKULL` that are known where the scan shows nothing; fringe (n,) bool : the points of the skin that are
    known to lie under hair (None: none are)
    """
    covered = under_hair(space, fit, target)
    fringe = np.zeros_like(covered) if fringe is None else fringe
    covered |= fringe
    unsure = [side for side in "lr" if not any(f"{name}_{side}" in given for name in EAR_MARKS)]
    telling = without_moved(space) if shown.parted else space
    if not covered.any():
        work = fit_shape(space, target, fit.pose, CHANGE, fit.coefficients, 1, shown, hair=covered)
        fit = yield from part_of(work, 0, 3)
        work = fit_shape(telling, target, fit.pose, LOOSE, fit.coefficients, 1, shown, hair=covered)
        scalp = yield from part_of(work, 1, 3)
        if skull:
            told = told_of_skull(space, scalp, skull)
            work = fit_shape(telling, target, scalp.pose, LOOSE, scalp.coefficients, 1, shown, told, covered)
            scalp = yield from part_of(work, 2, 3)
        likeness = like_ears(space, fit, target)
        hidden = tuple(side for side in unsure if likeness[side] < LIKE_AN_EAR)
        return UnderHair(fit, scalp, covered, covered, hidden)
    bare = np.flatnonzero(in_face(space, fit, {}, INNER) & ~fringe)
    held = Told(np.repeat(bare[:, None], 3, axis=1), np.full((len(bare), 3), 1 / 3), fit.points[bare])
    held = held.and_of(told_of_skull(space, fit, skull) if skull else None)

    def without(sides):
        """The work of a fit that knows nothing of the ears of these ``sides``, and the points of skin about those."""
        about = beside_face(space, fit, sides)
        hair = covered | about
        return fit_shape(space, target, fit.pose, CHANGE, fit.coefficients, 1, shown, held, hair), about

    likeness = like_ears(space, fit, target)
    work, about = without(unsure)
    guessed = yield from part_of(work, 0, 3)
    seen = {side: ear_found(space, guessed, target, side) * (likeness[side] >= LIKE_AN_EAR) for side in unsure}
    least = BESIDE_HIDDEN if min(seen.values(), default=1.0) < FOUND else FOUND
    hidden = [side for side in unsure if seen[side] < least]
    if hidden != unsure:
        work, about = without(hidden)
        guessed = yield from part_of(work, 1, 3)
    fit = guessed
    told = told_of_skull(space, fit, skull) if skull else None
    work = fit_shape(telling, target, fit.pose, LOOSE, fit.coefficients, 1, shown, told, covered | about)
    scalp = yield from part_of(work, 2, 3)
    off, far = stands_clear(space, scalp, target, OFF), stands_clear(space, fit, target, HIGH)
    covered |= off & (about | space.hairy)
    for side in hidden:
        covered |= _ear(space, side)
    return UnderHair(fit, scalp, covered, covered & far, tuple(hidden))


def scalp_by_face(space: ShapeSpace, hair: UnderHair, covered, given) -> ShapeFit:
    """The looser fit of ``hair``, beside the face as the closer one where neither ear is seen: skin tells of that next to it.

    covered (n,) bool : the points of the skin that are not seen; given : name -> (3,) mm, landmarks
    """
    face = in_face(space, hair.fit, given, 0.0) & ~covered
    if not hair.earless or not face.any():
        return hair.scalp
    near = np.exp(-((cKDTree(space.points[face]).query(space.points)[0] / BY_FACE) ** 2))[:, None]
    return replace(hair.scalp, points=hair.scalp.points + near * (hair.fit.points - hair.scalp.points))


def stands_clear(space: ShapeSpace, fit: ShapeFit, target: Surface, least: float) -> np.ndarray:
    """(n,) bool: the points of the skin from which the scan stands off by more than ``least`` mm for the most part."""
    _, near, _, high = over(fit, space, target)
    near, high = near[near >= 0], high[near >= 0] / fit.pose.scale
    n = len(space.points)
    return np.bincount(near, high > least, n) > 0.5 * np.bincount(near, minlength=n)


def told_of_skull(space: ShapeSpace, fit: ShapeFit, skull: dict[str, np.ndarray]) -> Told:
    """What landmarks of the skull, name -> (3,) mm, tell: how high the skin lies there, and little of where along it."""
    told = Told.of(space, skull)
    at, across = (
        np.einsum("kij,ki->kj", field[told.corners], told.weights)
        for field in (fit.points, vertex_normals(fit.points, space.triangles))
    )
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return replace(told, places=at + np.einsum("ij,ij->i", told.places - at, across)[:, None] * across)


def without_moved(space: ShapeSpace) -> ShapeSpace:
    """``space`` in which skin that expressions of the lower face move counts for hardly anything."""
    return replace(space, area=space.area * np.where(space.moving, HARDLY, 1.0))


def about_ears(space: ShapeSpace, sides: Collection[str]) -> np.ndarray:
    """(n,) bool: the points of the skin about the ears of ``sides``."""
    about = np.zeros(len(space.points), dtype=bool)
    for side in sides:
        about |= cKDTree(space.points[_ear(space, side)]).query(space.points)[0] < WITH_EARS
    return about


def beside_face(space: ShapeSpace, fit: ShapeFit, sides: Collection[str]) -> np.ndarray:
    """(n,) bool: the points of the skin about the ears of ``sides`` that hair hides with them: those outside of the face."""
    return about_ears(space, sides) & ~in_face(space, fit, {}, EDGE)


def ear_found(space: ShapeSpace, fit: ShapeFit, target: Surface, side: str) -> float:
    """0..1, the share of an ear by which the scan lies, of a ``fit`` to all of it but that ear."""
    reach = NEAR_EAR * fit.pose.scale
    return float(target.closest(fit.points[_ear(space, side)], reach).found.mean())


def _ear(space, side):
    return (space.ear > EAR) & space.on_side(side)


def under_hair(space: ShapeSpace, fit: ShapeFit, target: Surface) -> np.ndarray:
    """(n,) bool: the points of the skin over which the scan ``target`` shows hair."""
    size = fit.pose.scale
    away = cKDTree(space.points[space.ear > EAR]).query(space.points)[0] > FROM_EAR
    bare = forehead(space)
    covered = np.zeros(len(fit.points), dtype=bool)
    coarse = target.coarser()
    middle, near, off, high = over(fit, space, coarse, slice(None, None, max(len(coarse.triangles) // MANY, 1)))
    # At right angles at most, and not on flat ends.
    facing = (near >= 0) & ((off**2).sum(axis=1) < 2.0) & ~beyond(cuts_of(target), middle)
    middle, near, off, high = middle[facing], near[facing], off[facing], high[facing]
    look, plain = (space.hairy & away)[near], bare[near]
    if not look.any():
        return covered
    usual = np.percentile(varied(middle[plain], off[plain], AROUND * size), SMOOTH) if plain.any() else 0.0
    at = np.flatnonzero(space.hairy)
    link = within(fit.points[at], fit.points[near[look]], MOSTLY * size)
    count = np.maximum(np.asarray(link.sum(axis=1)).ravel(), 1)
    rough = varied(middle[look], off[look], AROUND * size) > max(ROUGH, ROUGHER * usual)
    rough &= varied(middle[look], high[look, None], AROUND * size) > UNEVEN * size
    hair = rough | (high[look] > HIGH * size)
    covered[at] = link @ hair / count > 0.5
    if space.area[covered].sum() < LEAST * space.area[space.hairy].sum():
        covered[:] = False
    return covered


def hair_over(space: ShapeSpace, fit: ShapeFit, target: Surface, covered) -> np.ndarray:
    """(m,) bool: the triangles of the scan over the points ``covered`` (n,) bool of the skin."""
    if not covered.any():
        return np.zeros(len(target.triangles), dtype=bool)
    near = over(fit, space, target)[1]
    return (near >= 0) & covered[near]


def over(fit: ShapeFit, space: ShapeSpace, surface: Surface, triangles=slice(None)):
    """Of ``triangles`` of a surface: their middles (k, 3) mm, the points of the skin (k,) nearest to them, -1 where none is
    near, how their normals differ from the skin's (k, 3), and mm by which they stand off it (k,)."""
    skin = Surface(fit.points, space.triangles)
    own = cKDTree(fit.points).query(skin.vertices)[1]  # a surface numbers its vertices anew
    middle = surface.vertices[surface.triangles[triangles]].mean(axis=1)
    found = skin.closest(middle, STANDS_OFF * fit.pose.scale)
    near = np.full(len(middle), -1)
    use = found.found & ~found.border
    near[use] = own[skin.triangles[found.triangle[use], found.weights[use].argmax(axis=1)]]
    high = np.einsum("ij,ij->i", middle - found.points, found.normals)
    return middle, near, surface.face_normals[triangles] - found.normals, np.where(use, high, 0.0)


def in_face(space: ShapeSpace, fit: ShapeFit, given, margin: float) -> np.ndarray:
    """(n,) bool: the points of the skin whose frontal projection lies, by a ``margin`` of mm, in the ellipse through zygia,
    trichion and gnathion: those of the landmarks ``given``, else as the ``fit`` has them."""
    back, size, shift = fit.pose.turn, fit.pose.scale, fit.pose.shift
    own = (fit.points - shift) @ back / size
    marks = space.landmarks(own) | {name: (place - shift) @ back / size for name, place in given.items()}
    left, right, top, bottom = (marks[name] for name in ("zy_l", "zy_r", "tr", "gn"))
    across = (own[:, 0] - (left[0] + right[0]) / 2) / ((left[0] - right[0]) / 2 + margin)
    up = (own[:, 2] - (top[2] + bottom[2]) / 2) / ((top[2] - bottom[2]) / 2 + margin)
    front = own[:, 1] < min(marks["t_l"][1], marks["t_r"][1])
    return (across**2 + up**2 < 1) & front


def forehead(space: ShapeSpace) -> np.ndarray:
    """(n,) bool: the points of the skin above the brows, below the scalp."""
    marks = space.landmarks(space.points)
    above = max(marks["sci_l"][2], marks["sci_r"][2])
    return (space.face > 0.5) & (space.points[:, 2] > above) & ~space.hairy


def within(points, others, radius: float) -> csr_matrix:
    """(k, j) sparse, 1 where one of ``points`` (k, 3) and one of the ``others`` (j, 3) are no farther apart than that."""
    near = cKDTree(points).sparse_distance_matrix(cKDTree(others), radius, output_type="ndarray")
    out = csr_matrix((np.ones(len(near)), (near["i"], near["j"])), shape=(len(points), len(others)))
    out.sort_indices()  # sums do not depend on how the tree was walked
    return out


def varied(points, off, radius: float) -> np.ndarray:
    """(k,) by which values ``off`` (k, d), how normals differ for one, vary about each of ``points`` (k, 3)."""
    link = within(points, points, radius)
    count = np.maximum(np.asarray(link.sum(axis=1)).ravel(), 1)
    mean, square = link @ off / count[:, None], link @ (off**2).sum(axis=1) / count
    return np.sqrt(np.maximum(square - (mean**2).sum(axis=1), 0))
