# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything under the skin follows it: bone, eyes, teeth, tongue, muscles (Kähler et al. 2002, section 5.2)."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from ..anatomy.head import Head, Muscle
from ..anatomy.muscle_room import Room
from ..anatomy.muscle_shape import reshaped
from ..anatomy.tissue_depth import tissue_vectors
from ..progress import Progress, Work
from . import bone, eyeballs
from .closest import Surface
from .openings import lids_apart, lips_apart, rims, sealed_lids
from .refine import scattered, thinned
from .skin_fit import SkinFit, group
from .thin_plate_spline import System, ThinPlateSpline, similarity
from .untangle import restored, untangled

BONES = ("skull", "mandible")
TEETH = ("teeth_upper", "teeth_lower")
AROUND_EYE = 32.0  # mm: bone this near carries the eye
AROUND_TEETH = 28.0
BEHIND_LIPS = 12.0  # mm: teeth this near to the skin have lips or cheeks over them
LIP_LEFT = 0.75  # share of that distance that must remain
COARSE = 14.0  # mm between centres of the last warps, away from lids and lips
GAPS = (("skull", 18.0), ("mandible", 12.0), ("eye_l", 7.0), ("eye_r", 7.0), ("teeth_upper", 8.0), ("teeth_lower", 8.0))
BUSY = ("lip_upper", "lip_lower") + tuple(f"{x}_{s}" for x in ("lid_upper", "lid_lower", "nostril") for s in ("l", "r"))


@dataclass(frozen=True, eq=False)
class Carried:
    """head : the fitted head; moved : mm by which bone had to give way to the skin (largest)."""

    head: Head
    moved: float


def carry(reference: Head, fit: SkinFit) -> Work:
    """Work returning the `Carried` head: ``reference`` with the fitted skin and all that lies under it."""
    skin = reference.skin
    triangles = skin.triangles
    inner = group(reference, "inner") > 0.5
    fitted = fit.fitted.vertices
    size, _ = similarity(skin.vertices[~inner], fitted[~inner])
    scale = float(np.cbrt(np.linalg.det(size)))

    yield Progress(0.0, "Skull")
    deep, through = under_skin(reference, fit)
    parts = {name: through.transform(deep.transform(reference.parts[name].vertices)) for name in BONES}
    parts = bone_by_depth(reference, parts, fitted, size / scale, scale)

    yield Progress(0.25, "Eyes and teeth")
    eyes = []
    for k, side in enumerate(("l", "r")):
        old = reference.eyes[k]
        around = near_bone(reference, parts, old.centre[None], AROUND_EYE)
        lid = np.maximum(group(reference, f"lid_upper_{side}"), group(reference, f"lid_lower_{side}"))
        new, turn = eyeballs.place_eye(old, around, skin.vertices, fitted, lid, inner, scale)
        eyes.append(new)
        parts[f"eye_{side}"] = eyeballs.carried_eyeball(reference.parts[f"eye_{side}"].vertices, old, new, turn)
    mouth = mouth_similarity(reference, parts, fitted, fit.outer)
    for name in (*TEETH, "tongue"):
        parts[name] = mouth(reference.parts[name].vertices)

    yield Progress(0.35, "Inner skin")
    between = Between(reference)
    final = fitted.copy()
    # The linings of the lips were solved together with the rims; all else inside lies between what surrounds it.
    rim = rims(reference)
    lining = np.maximum(group(reference, "lip_upper"), group(reference, "lip_lower")) > 0.3
    deep = inner & ~lining
    final[deep] = between.warp(parts, fitted).transform(skin.vertices[deep])
    final = lips_apart(reference, final, inner, size)
    for k, side in enumerate(("l", "r")):
        if side in fit.closed:
            final = lids_apart(reference, rim, final, reference.landmarks.on({"skin": fitted}), size[:, 2], side)
            final = sealed_lids(reference, rim, final, eyes[k], side)
        final = lids_on_eye(reference, final, parts[f"eye_{side}"], eyes[k], k, side, inner)

    yield Progress(0.45, "Untangle the skin")
    shut = rim & lining  # where lips meet is seen, a fold behind them is not
    for side in fit.closed:  # closed lids lie too close for the reference's open ones to be restored
        for lid in ("lid_upper", "lid_lower"):
            shut |= group(reference, f"{lid}_{side}") > 0.2
    final = restored(skin.vertices, final, skin.faces, fit.unseen, scale)
    final = untangled(skin.vertices, final, skin.faces, triangles, ~(inner | fit.unseen), shut)

    yield Progress(0.5, "Bone under the skin")
    surface = Surface(final, triangles)
    moved = 0.0
    for name in BONES:
        before, least = parts[name], bone_needs(reference, name, scale)
        parts[name] = bone.keep_inside(reference.parts[name].moved(before), surface, least)
        moved = max(moved, float(np.linalg.norm(parts[name] - before, axis=1).max()))
    jaw = carried_jaw(reference, parts, mouth, scale)
    parts["skin"] = final

    yield Progress(0.8, "Muscles")
    warp = between.warp(parts, final)
    bones = [reference.parts[n].moved(parts[n]) for n in BONES]
    room = Room(skin.moved(final), bones, inner, [(eye.centre, eye.radius) for eye in eyes])
    muscles = tuple(carried_muscle(m, warp, room) for m in reference.muscles)
    head = replace(reference.with_vertices(parts), muscles=muscles, jaw=jaw, eyes=tuple(eyes))
    return Carried(head, moved)


def under_skin(reference: Head, fit: SkinFit):
    """The warps of space up to the last stage, and one more that follows what the last stage added (step 4)."""
    outer = np.unique(fit.outer)
    outer = outer[scattered(reference.skin.vertices[outer], COARSE)]
    source, target = fit.chain.transform(reference.skin.vertices[outer]), fit.fitted.vertices[outer]
    return fit.chain, ThinPlateSpline.fit(source, target, 1.0)


def bone_by_depth(reference: Head, parts, fitted, turn, scale):
    """Skull and mandible moved so that their landmarks lie a tissue depth under the skin's (step 6)."""
    vertices = {**reference.vertices(), **parts, "skin": fitted}
    vectors = tissue_vectors(reference.landmark_positions(), reference.skull_landmark_positions())
    # Soft tissue grows less than the head does: the depths of a small head shrink by half as much.
    vectors = {name: (scale**0.5) * turn @ v for name, v in vectors.items()}
    marks = reference.skull_landmarks.on(vertices)
    landmarks = reference.landmarks.on(vertices)
    return {name: bone.follow_skin(parts[name], marks, landmarks, vectors) for name in parts}


def bone_needs(reference: Head, name: str, scale: float) -> np.ndarray:
    """(n,) mm of tissue that must remain over each vertex of a bone, from what the reference has there."""
    surface = Surface(reference.skin.vertices, reference.skin.triangles)
    depth, found = bone.depth_under(reference.parts[name].vertices, surface, bone.NEAR)
    inner = group(reference, "inner") > 0.5
    # `Surface` welds, so the cups are told by the skin's own nearest vertex.
    nearest = cKDTree(reference.skin.vertices).query(np.where(found.found[:, None], found.points, 0.0))[1]
    return bone.least_depth(depth, inner[nearest] & found.found) * min(scale, 1.0)


def near_bone(reference: Head, parts, points, radius):
    """Callable that carries points as the bone within ``radius`` mm of ``points`` (k, 3) moves: a similarity."""
    source = np.concatenate([reference.parts[name].vertices for name in BONES])
    target = np.concatenate([parts[name] for name in BONES])
    pick = cKDTree(points).query(source)[0] < radius
    if pick.sum() < 12:
        pick[:] = True
    matrix, shift = similarity(source[pick], target[pick])
    return lambda x: np.asarray(x) @ matrix.T + shift


def mouth_similarity(reference: Head, parts, fitted, outer):
    """Callable that carries teeth and tongue: rigid crowns on the jaws' own movement, as far behind the lips as ever.

    One similarity for both jaws, so that the teeth bite as they do on the reference.
    """
    teeth = np.concatenate([reference.parts[name].vertices for name in TEETH])
    with_bone = near_bone(reference, parts, teeth, AROUND_TEETH)
    teeth = teeth[scattered(teeth, 3.0)]
    before = room_over(teeth, Surface(reference.skin.vertices, outer))[0]
    teeth, before = teeth[before < BEHIND_LIPS], before[before < BEHIND_LIPS]
    lips = Surface(fitted, outer)
    shift = np.zeros(3)
    for _ in range(4):
        after, inward = room_over(with_bone(teeth) + shift, lips)
        lack = np.where(np.abs(after) < BEHIND_LIPS, LIP_LEFT * before - after, 0.0)
        short = float(np.percentile(lack, 98)) if len(lack) else 0.0
        if short < 0.1:
            break
        way = inward[lack > 0].mean(axis=0)
        shift = shift + short * way / max(float(np.linalg.norm(way)), 0.3)
    return lambda x: with_bone(x) + shift


def room_over(points, skin: Surface):
    """(k,) mm from points (k, 3) out to the skin, negative outside, and (k, 3) the way in."""
    found = skin.closest(points)
    height = np.einsum("ij,ij->i", found.points - points, found.normals)
    return np.where(height < 0, -found.distance, found.distance), -found.normals


class Between:
    """The warp for what lies between the surfaces: skin seen from outside, bone, eyeballs and teeth all carry it.

    Made once for a reference; ``warp(parts, skin)`` solves it for fitted parts (name -> (n, 3) mm) and skin (n, 3).
    """

    def __init__(self, reference: Head):
        skin = reference.skin.vertices
        outer = np.flatnonzero(group(reference, "inner") <= 0.5)
        busy = np.zeros(len(skin), dtype=bool)
        for name in BUSY:
            busy |= group(reference, name) > 0.3
        far = outer[~busy[outer]]
        self._pick = {"skin": np.concatenate([outer[busy[outer]], far[scattered(skin[far], COARSE)]])}
        for name, gap in GAPS:
            self._pick[name] = scattered(reference.parts[name].vertices, gap)
        source = np.concatenate([reference.parts[name].vertices[pick] for name, pick in self._pick.items()])
        self._keep = thinned(source, 0.2)
        self._system = System(source[self._keep], 0.05)

    def warp(self, parts, skin) -> ThinPlateSpline:
        """The spline that takes the reference's parts to these."""
        target = [(skin if name == "skin" else parts[name])[pick] for name, pick in self._pick.items()]
        return self._system.solve(np.concatenate(target)[self._keep])


def lids_on_eye(reference: Head, skin, ball, eye, k: int, side: str, inner):
    """Lids outside the eyeball: their backs touch it, their outside keeps a lid's thickness above it."""
    old = reference.eyes[k]
    lid = np.maximum(group(reference, f"lid_upper_{side}"), group(reference, f"lid_lower_{side}"))
    rest = reference.skin.vertices - old.centre
    height = np.linalg.norm(rest, axis=1) - eyeballs.profile_of(old)(angle_from(rest, old.gaze))
    rows = np.flatnonzero((lid > 0.05) & (height < 0.4 * old.radius) & (rest @ old.gaze > 0))
    if len(rows) == 0:
        return skin
    gap = np.where(inner[rows], np.clip(height[rows], 0.02, 0.1), np.clip(height[rows], 0.05, 0.5))
    return eyeballs.lids_over(skin, eye, eyeballs.profile_of(eye), rows, gap)


def angle_from(vectors, direction):
    """(k,) rad between vectors (k, 3) and a unit direction."""
    length = np.linalg.norm(vectors, axis=1)
    return np.arccos(np.clip(vectors @ direction / np.maximum(length, 1e-9), -1, 1))


def carried_muscle(muscle: Muscle, warp, room: Room) -> Muscle:
    """A muscle whose fibres went through ``warp`` and whose belly is made anew in the room there is (5.2, item 3)."""
    centre = None if muscle.centre is None else warp.transform(muscle.centre[None])[0]
    return reshaped(muscle, warp.transform(muscle.fibres), room, centre)


def carried_jaw(reference: Head, parts, mouth, scale: float):
    """The hinge on the fitted mandible: condyles with the bone around them, the incisor with the teeth."""
    old = reference.jaw
    source, target = reference.parts["mandible"].vertices, parts["mandible"]
    condyles = []
    for point in (old.condyle_l, old.condyle_r):
        near = np.argsort(np.linalg.norm(source - point, axis=1), kind="stable")[:16]
        weight = 1 / (1.0 + np.linalg.norm(source[near] - point, axis=1))
        condyles.append(point + weight @ (target[near] - source[near]) / weight.sum())
    return replace(
        old,
        condyle_l=condyles[0],
        condyle_r=condyles[1],
        incisor=mouth(old.incisor[None])[0],
        slide_max=old.slide_max * scale,
        side_max=old.side_max * scale,
        forward_max=old.forward_max * scale,
    )
