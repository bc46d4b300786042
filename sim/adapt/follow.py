# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything under the skin follows it: bone, eyes, teeth, tongue, muscles (Kähler et al. 2002, section 5.2).

The skin may have been moved by anything: fitted to a scan, varied at random, grown. No step of this is manual: bone
keeps its tissue depths, eyeballs stay spheres under the lids, teeth stay rigid behind the lips, and what lines the
mouth and the lids goes with them.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from ..anatomy.head import Head
from ..anatomy.tissue_depth import tissue_vectors
from ..progress import Progress, Work, portion
from . import bone, eyeballs
from .bone_inside import keeping_inside
from .lining import lined, lips_met, lips_parted
from .mouth import mouth_similarity, with_teeth
from .muscles import carried_muscles
from .nostril_walls import within_bone
from .rest import BONES, TEETH, Rest, rest_of
from .skin_cover import SkinCover
from .skin_groups import group
from .thin_plate_spline import similarity
from .untangle import restored, untangling

AROUND_EYE = 32.0  # mm: bone this near carries the eye


@dataclass(frozen=True, eq=False)
class Followed:
    """head : the whole head; moved : mm by which bone had to give way to the skin (largest)."""

    head: Head
    moved: float


def follow(
    reference: Head, skin: np.ndarray, unseen: np.ndarray | None = None, nostrils: np.ndarray | None = None
) -> Work:
    """Work returning `Followed`: ``reference`` under another skin.

    Parameters
    ----------
    reference : the head that was warped
    skin : (n, 3) mm, its skin after the warp; the linings of mouth, lids and nostrils in it are not looked at
    unseen : (n,) bool, vertices that are to have the reference's own shape (None: none)
    nostrils : (n, 3) mm, how much farther in than the skin around them has them their linings lie (None: no farther)
    """
    rest = rest_of(reference)
    start = reference.skin.vertices
    seen = ~rest.inner
    unseen = np.zeros(len(start), dtype=bool) if unseen is None else unseen
    size, _ = similarity(start[seen], skin[seen])
    scale = float(np.cbrt(np.linalg.det(size)))

    yield Progress(0.0, "Skull")
    space = rest.space(skin)
    parts = {name: space.transform(reference.parts[name].vertices) for name in BONES}
    parts = bone_by_depth(reference, parts, skin, size / scale, scale)
    mouth = mouth_similarity(rest, space, skin)
    parts = {name: with_teeth(rest, name, moved, mouth) for name, moved in parts.items()}

    yield Progress(0.25, "Eyes and teeth")
    eyes, carried, skull = [], {"mouth": mouth}, parts["skull"]
    both = [near_bone(rest, parts, eye.centre[None], AROUND_EYE) for eye in reference.eyes]
    margins = [rest.at_iris[side] for side in "lr"]
    turn = eyeballs.gaze_turn(reference.eyes, both)  # of both: by the bone around each, people squint
    for old, around, side, margin in zip(reference.eyes, both, "lr", margins, strict=True):
        lids = rest.lids(side), rest.inner, margin
        eyes.append(eyeballs.place_eye(old, around, turn, start, skin, *lids, scale))
    eyes, turn = eyeballs.looking_between_lids(reference.eyes, eyes, turn, start, skin, margins)
    for old, new, around, side in zip(reference.eyes, eyes, both, "lr", strict=True):
        skull = eyeballs.with_orbit(skull, new, new.centre - around(old.centre[None])[0])
        carried[f"eye_{side}"] = eyeballs.eye_similarity(old, new, turn)
    parts["skull"] = skull
    for name in (*TEETH, "tongue"):
        parts[name] = mouth(reference.parts[name].vertices)

    yield Progress(0.35, "Inner skin")
    final = np.array(skin, dtype=float)
    for slit in rest.slits.values():
        final = restored(rest, final, slit.hidden)
    final = lips_met(rest, final, size)
    for organ in rest.organs:
        final = lined(rest, final, organ, carried.get(organ))
    if nostrils is not None:
        final = within_bone(rest, final + nostrils, reference.parts["skull"].moved(parts["skull"]))
    final = lips_met(rest, final, size)
    for eye, side in zip(eyes, "lr", strict=True):
        final = eyeballs.lids_on_eye(rest, final, eye, side)

    yield Progress(0.45, "Untangle the skin")
    lining = np.maximum(group(reference, "lip_upper"), group(reference, "lip_lower")) > 0.3
    shut = (rest.rim | seen) & lining  # lips and where they meet are seen, a fold behind them is not
    final = restored(rest, final, unseen, scale, np.maximum(group(reference, "ear_l"), group(reference, "ear_r")))
    final = yield from portion(untangling(rest, final, seen & ~unseen, shut), 0.45, 0.55)
    final = lips_parted(rest, final, size)
    for eye, side in zip(eyes, "lr", strict=True):
        final = eyeballs.settled_lids(rest, final, eye, side)
        if side in rest.slits:
            final = rest.slits[side].met(final, eye, reference.landmarks.on({"skin": final}))
    parts["skin"] = final
    for k, (eye, side) in enumerate(zip(eyes, "lr", strict=True)):
        part = f"eye_{side}"
        work = eyeballs.eye_part(rest, side, final, carried[part], eye)
        parts[part] = yield from portion(work, 0.55 + 0.03 * k, 0.58 + 0.03 * k)

    yield Progress(0.61, "Bone under the skin")
    cover = SkinCover(reference.skin.moved(final), group(reference, "inner"), bone.LINING)
    moved = 0.0
    for k, name in enumerate(BONES):
        before = parts[name]
        least = np.maximum(rest.needs[name] * min(scale, 1.0), bone.LEAST)
        work = keeping_inside(reference.parts[name].moved(before), cover, least)
        parts[name] = yield from portion(work, 0.62 + 0.18 * k / len(BONES), 0.62 + 0.18 * (k + 1) / len(BONES))
        moved = max(moved, float(np.linalg.norm(parts[name] - before, axis=1).max()))
    jaw = carried_jaw(rest, parts, mouth, scale)

    yield Progress(0.8, "Muscles")
    work = carried_muscles(rest, parts, eyes, rest.between(parts, final))
    muscles = yield from portion(work, 0.8, 1.0)
    head = replace(reference.with_vertices(parts), muscles=muscles, jaw=jaw, eyes=tuple(eyes))
    return Followed(head, moved)


def near_bone(rest: Rest, parts, points, radius):
    """Callable that carries points as the bone within ``radius`` mm of ``points`` (k, 3) moves: a similarity.

    parts : bone -> (n, 3) mm, where the bones are now
    """
    source = np.concatenate([rest.head.parts[name].vertices for name in BONES])
    target = np.concatenate([parts[name] for name in BONES])
    pick = cKDTree(points).query(source)[0] < radius
    if pick.sum() < 12:
        pick[:] = True
    matrix, shift = similarity(source[pick], target[pick])
    return lambda x: np.asarray(x) @ matrix.T + shift


def bone_by_depth(reference: Head, parts, skin, turn, scale):
    """Skull and mandible moved so that their landmarks lie a tissue depth under the skin's (5.2, item 2)."""
    vertices = {**reference.vertices(), **parts, "skin": skin}
    vectors = tissue_vectors(reference.landmark_positions(), reference.skull_landmark_positions())
    # Soft tissue grows less than the head does: the depths of a small head shrink by half as much.
    vectors = {name: (scale**0.5) * turn @ v for name, v in vectors.items()}
    marks = reference.skull_landmarks.on(vertices)
    landmarks = reference.landmarks.on(vertices)
    return {name: bone.follow_skin(parts[name], marks, landmarks, vectors) for name in parts}


def carried_jaw(rest: Rest, parts, mouth, scale: float):
    """The hinge on the moved mandible: condyles with the bone around them, the incisor with the teeth."""
    old = rest.head.jaw
    source, target = rest.head.parts["mandible"].vertices, parts["mandible"]
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
