# SPDX-License-Identifier: GPL-3.0-or-later
"""Teeth and tongue under a fitted skin: rigid crowns on the jaws' own movement, as far behind the lips as ever."""

import numpy as np

from .closest import Surface
from .refine import scattered
from .rest import TEETH, Rest
from .thin_plate_spline import similarity

HELD, FREE = (
    3.0,
    14.0,
)  # mm from teeth and their roots: up to where bone goes as they do, and from where it goes its own way
BEHIND_LIPS = 12.0  # mm: teeth this near to the skin have lips or cheeks over them
LIPS = 1.5  # weight of the lips, of all teeth 1, in where the mouth goes
LIP_LEFT = 0.75  # share of that distance that must remain
SOUND = 6.0  # mm: who lacks more looks out between the lips, where the skin's side tells nothing


def mouth_similarity(rest: Rest, space, fitted):
    """Callable that carries teeth, gums, tongue and mouth bag.

    One similarity for both jaws, so that the teeth bite as they do on the reference. ``space`` (`Rest.space`) tells
    where they would come to lie, ``fitted`` (n, 3) is the skin that must have room for them.
    """
    teeth = np.concatenate([rest.head.parts[name].vertices for name in TEETH])
    teeth = teeth[scattered(teeth, 3.0)]
    start = rest.head.skin.vertices
    rim = rest.lip_rim
    weights = np.concatenate([np.full(len(teeth), 1 / len(teeth)), np.full(len(rim), LIPS / max(len(rim), 1))])
    matrix, base = similarity(
        np.concatenate([teeth, start[rim]]), np.concatenate([space.transform(teeth), fitted[rim]]), weights
    )
    before, _, sure = _room_over(teeth, Surface(start, rest.outer))
    near = sure & (before > 0) & (before < BEHIND_LIPS)
    teeth, before = teeth[near], before[near]
    lips = Surface(fitted, rest.outer)
    shift = np.zeros(3)
    for _ in range(6):
        after, inward, sure = _room_over(teeth @ matrix.T + base + shift, lips)
        lack = np.maximum(LIP_LEFT * before - after, 0.0)
        lack[~sure | (lack > SOUND)] = 0.0
        if lack.max(initial=0) < 0.1:
            break
        # The least shift that gives room where it lacks, in the mean: one side's gain is not the other's loss.
        way = inward[lack > 0]
        shift = shift + np.linalg.solve(way.T @ way + 2.0 * np.eye(3), way.T @ lack[lack > 0])
    return lambda points: np.asarray(points) @ matrix.T + base + shift


def with_teeth(rest: Rest, name: str, bone, mouth) -> np.ndarray:
    """A bone's vertices (n, 3) with the sockets where the teeth are: near them it goes as they do (``mouth``)."""
    start = rest.head.parts[name].vertices
    away = rest.from_teeth[name]
    share = np.clip((FREE - away) / (FREE - HELD), 0, 1)[:, None]
    share = share * share * (3 - 2 * share)
    return bone + share * (mouth(start) - bone)


def _room_over(points, skin: Surface):
    """(k,) mm from points (k, 3) out to the skin, negative outside, (k, 3) the way in, and (k,) bool: that is sure.

    Between the lips a point is nearest to their rims, which tells nothing.
    """
    found = skin.closest(points)
    height = np.einsum("ij,ij->i", found.points - points, found.normals)
    return np.where(height < 0, -found.distance, found.distance), -found.normals, ~found.border
