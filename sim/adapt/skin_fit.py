# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin of the reference fitted to a scan: warp, refine, reach the data (Kähler et al. 2002, section 6)."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, vstack

from ..anatomy.head import Head, SurfacePoints
from ..anatomy.landmark_names import SKIN
from ..blas import on_one_thread
from ..mesh import vertex_normals
from ..mesh_subdivision import drawn, undrawn
from ..progress import Progress, Work
from .closest import Surface
from .completion import complete_positions, mirror_plane, sigma
from .ears import EAR_MARKS, ear_sheets, unseen_ears
from .fine_fit import Anchors, Fitted, fine_fit
from .lid_line import met_at
from .openings import between_lids, closed_eyes, lid_margins, offset_anchors, rim_anchors, rims
from .refine import Pairs, refine
from .shut_eyes import with_shut_eyes
from .skin_groups import group
from .sliding import slide, spread_sites
from .sliding_warp import Mirror
from .thin_plate_spline import ThinPlateSpline, similarity

STIFF = tuple(f"{x}_{s}" for x in ("lid_upper", "lid_lower", "nostril") for s in ("l", "r"))
CARRIED = 60.0  # smoothing of the first warp at a landmark that was not given, mm
GUESSED = 10.0  # the same at one that is guessed
PICKED = 1.0  # the same at a given one, per mm of its uncertainty
LID_MARKS = ("ps_l", "ps_r", "pi_l", "pi_r")
LOOSE = 20.0  # how much less the shape of a lid's margin counts in an eye that is as open as the reference's
REFINED = 1  # rounds of refinement: what is finer slides
UNSURE = 0.3  # mm along the surface by which sliding may miss a landmark, per mm of smoothing
THICKNESS = 0.05  # weight in the last stage of how thick an ear is
HOLD = 0.15  # weight in the last stage of a landmark picked to 1 mm, against 1 for a point of data
#: Of landmarks that were found, not picked: factors on how far sliding may miss them, and on their weight in the last stage.
#: Not of ears, lips and lids, in whose folds data alone would lead astray.
FOUND_MISS, FOUND_HOLD = 6.0, 0.1
FOLDS = (*EAR_MARKS, "ls", "li", "sto", "ch", "cph", "en", "ex", "ps", "pi")


@dataclass(frozen=True, eq=False)
class SkinFit:
    """What `fit_skin` returns.

    reference : the head that was fitted: the reference, its lids shut where the scan's are, its lips parted if they are
    fitted : the skin after the last stage, as it is drawn
    cage (n, 3) mm : the skin that is drawn like that
    landmarks : name -> (3,) mm, given and completed targets
    outer (t, 3) : triangles a scanner can see; target : the scan as used (turned if it was inside out)
    closed : sides ("l", "r") of closed eyes
    unseen (n,) bool : vertices on and around ears that the scan does not show
    lips_closed : ``reference`` before its lips were parted; the same where they were not
    """

    reference: Head
    fitted: Fitted
    cage: np.ndarray
    landmarks: dict[str, np.ndarray]
    outer: np.ndarray
    target: Surface
    closed: list[str]
    unseen: np.ndarray
    lips_closed: Head


def landmark_rows(points: SurfacePoints, names, n: int) -> csr_matrix:
    """(k, n) sparse rows that give the named skin landmarks from the skin's vertices."""
    at = [points.names.index(name) for name in names]
    rows = np.repeat(np.arange(len(at)), 3)
    return csr_matrix((points.weights[at].ravel(), (rows, points.corners[at].ravel())), shape=(len(at), n))


def fit_skin(
    reference: Head,
    target: Surface,
    given: dict[str, np.ndarray],
    lips: dict[str, np.ndarray] | None = None,
    found: Collection[str] = (),
    guessed: dict[str, np.ndarray] | None = None,
) -> Work:
    """Work returning the `SkinFit` of ``reference`` to the scan ``target`` with the landmarks ``given`` (mm).

    lips : name -> (3,) mm, about where landmarks of lips are that are known to be apart, if only a little
    found : names of those given that nobody picked; the data around them count for more
    guessed : name -> (3,) mm, about where others are; the skin begins there, and data may take it elsewhere

    It is the surface drawn of the skin, the limit of its subdivision, that is laid on the scan.
    """
    return on_one_thread(_fitting(reference, target, given, lips, found, guessed or {}))


def _fitting(
    reference: Head,
    target: Surface,
    given: dict[str, np.ndarray],
    apart: dict[str, np.ndarray] | None,
    found: Collection[str],
    guessed: dict[str, np.ndarray],
) -> Work:
    yield Progress(0.0, "Looking at lids and lips")
    data = target.coarser()
    lips_closed, closed = as_scanned(reference, given)
    whole, given, lips = with_lips_as_scanned(lips_closed, target, given, apart)
    reference = whole.with_vertices({"skin": drawn(whole.skin.faces, whole.skin.vertices)})
    skin = reference.skin
    n = len(skin.vertices)
    triangles = skin.triangles
    inner = group(reference, "inner") > 0.5
    outer = triangles[~inner[triangles].any(axis=1)]
    names = [name for name in SKIN if name in reference.landmarks.names]
    rows = landmark_rows(reference.landmarks, names, n)
    marks = rows @ skin.vertices
    landmarks = complete_positions(dict(zip(names, marks, strict=True)), given) | {
        name: place for name, place in guessed.items() if name in names and name not in given
    }
    goal = np.array([landmarks[name] for name in names])
    known = np.array([name in given for name in names])
    loose = np.array([name in found and name.partition("_")[0] not in FOLDS for name in names])
    give = np.where(known, [PICKED * sigma(name) for name in names], CARRIED)
    give[[name in guessed and name not in given for name in names]] = GUESSED
    rim = rims(reference)
    turn, shift = similarity(marks, goal)
    lines = {side: met_at(given, side, target, turn) for side in closed}
    margin, margin_goal, change = lid_margins(reference, rim, given, turn, closed, lines)
    data = data.without(between_lids(data, reference, given, turn, margin, margin_goal))
    pinched = change.max(initial=0.0)
    give[np.isin(names, LID_MARKS) & known] += CARRIED * pinched
    margin, margin_goal = np.concatenate([margin, lips[0]]), np.concatenate([margin_goal, lips[1]])
    sure = np.concatenate([LOOSE ** (change - 1), np.ones(len(lips[0]))])
    give = np.concatenate([give, PICKED / sure])

    yield Progress(0.0, "Warp to the landmarks")
    aim = np.concatenate([goal, margin_goal])
    first = ThinPlateSpline.fit(np.concatenate([marks, skin.vertices[margin]]), aim, give)
    moved = first.transform(skin.vertices)
    used = np.unique(outer)[::4]  # enough to tell
    if data.inside_out(moved[used], vertex_normals(moved, outer)[used], 20.0):
        target, data = target.turned(), data.turned()
    # Landmarks that were not given are where the skin is now; data will move them.
    now = np.concatenate([rows @ moved, moved[margin]])
    aim[: len(names)] = np.where(known[:, None], goal, now[: len(names)])
    pairs = Pairs(now, aim, give, len(names))
    unseen = unseen_ears(reference, given, moved, data)
    calm = refinable(reference, outer, rim | unseen)
    work = refine(moved, calm, data, feature_triangles(reference, names), pairs, REFINED)
    warps = None
    while warps is None:
        try:
            done, _ = next(work)
            yield Progress(0.05 + 0.2 * done, "Refine the landmarks")
        except StopIteration as stop:
            warps = stop.value
    for warp in warps:
        moved = warp.transform(moved)

    rest = skin.vertices @ turn.T + shift
    miss = UNSURE * give
    miss[: len(names)][loose] *= FOUND_MISS
    pairs = Pairs(np.concatenate([rows @ rest, rest[margin]]), aim, miss, len(names))
    sites = spread_sites(skin.vertices, calm, group(reference, "face") > 0.5)
    yield Progress(0.25, "Slide over the scan")
    point, normal = mirror_plane(dict(zip(names, marks, strict=True)))
    mirror = Mirror(turn @ point + shift, turn @ normal / np.linalg.norm(turn @ normal))
    moved = slide(rest, moved, outer, sites, data, pairs, mirror)

    free, stiffness = freedom(reference, given, rim, unseen)
    weight = np.where(known, [HOLD / sigma(name) ** 2 for name in names], 0.0)
    weight[loose] *= FOUND_HOLD
    weight[np.isin(names, LID_MARKS)] *= 1 - 0.9 * pinched
    matrix, _ = similarity(skin.vertices, moved)
    together = rim_anchors(reference, rim, matrix)
    thick = offset_anchors(reference, ear_sheets(reference), matrix, THICKNESS)
    on_margin = csr_matrix((np.ones(len(margin)), (np.arange(len(margin)), margin)), shape=(len(margin), n))
    anchors = Anchors(
        vstack([rows, on_margin, together.sampling, thick.sampling]).tocsr(),
        np.concatenate([goal, margin_goal, together.target, thick.target]),
        np.concatenate([weight, HOLD * sure**2, together.weight, thick.weight]),
    )
    start = undrawn(skin.faces, moved + (whole.skin.vertices - skin.vertices) @ matrix.T, moved)
    work = fine_fit(start, skin.faces, free, rim & ~unseen, data, anchors, stiffness)
    fitted = None
    while fitted is None:
        try:
            yield Progress(0.3 + 0.7 * next(work), "Reach the scan")
        except StopIteration as stop:
            fitted = stop.value
    return SkinFit(whole, fitted, fitted.cage, landmarks, outer, target, closed, unseen, lips_closed)


def as_scanned(reference: Head, given) -> tuple[Head, tuple[str, ...]]:
    """The reference with the lids shut of the eyes that the landmarks ``given`` show shut, and the sides of those."""
    rest = reference.landmark_positions()
    names = {name: rest[name] for name in SKIN if name in rest}
    closed = tuple(closed_eyes(reference, complete_positions(names, given), given))
    return (with_shut_eyes(reference, closed) if closed else reference), closed


def with_lips_as_scanned(reference: Head, target: Surface, given, lips=None):
    """The reference with its lips parted if the scan's are, the landmarks to fit it by, and the edges of its lips:
    vertices (k,) and places (k, 3) mm."""
    from ..relax.parted import parted_lips, with_parted_lips

    found = parted_lips(reference, target, given, lips)
    if found is None:
        return reference, given, (np.zeros(0, dtype=int), np.zeros((0, 3)))
    given = {name: place for name, place in given.items() if name != "sto"}  # it lies in mid-air
    return with_parted_lips(reference, found.expression), given, (found.rim, found.edges)


def feature_triangles(reference: Head, names) -> np.ndarray:
    """The reference's feature mesh (f, 3) with indices into ``names``."""
    place = {name: k for k, name in enumerate(names)}
    order = np.array([place.get(name, -1) for name in reference.landmarks.names], dtype=np.int32)
    return order[reference.feature_mesh]


def refinable(reference: Head, outer: np.ndarray, rim: np.ndarray) -> np.ndarray:
    """The triangles of ``outer`` on which refinement may place landmarks: not on rims, nostrils and ears, whose folds
    lie closer together than the feature mesh can tell apart."""
    folds = rim.copy()
    for name in ("ear_l", "ear_r", "nostril_l", "nostril_r"):
        folds |= group(reference, name) > 0.3
    return outer[~folds[outer].any(axis=1)]


def freedom(reference: Head, given, rim, unseen):
    """Which skin vertices look for data (n,) bool, and how stiff each is (n,)."""
    inner = group(reference, "inner") > 0.5
    free = ~inner & ~rim & ~unseen
    stiffness = 1 + 3.0 * inner + 8.0 * rim + 2.0 * group(reference, "neck") + 1.0 * group(reference, "scalp")
    for name in STIFF:
        stiffness += 4.0 * group(reference, name)
    for side in ("l", "r"):
        stiffness += 20.0 * group(reference, f"ear_{side}")
    return free, stiffness + 40.0 * unseen
