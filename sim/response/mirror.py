# SPDX-License-Identifier: GPL-3.0-or-later
"""Mirror images of samples: faces are nearly symmetric, so what one side was seen to do tells much of the other.

The image of a sample is a sample of the face seen in a mirror: another face, but one that answers nearly alike. How nearly
is measured on poses that were simulated both ways round, and the regression counts images for so much (`fit`).
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..acting.arkit import mirrored
from ..anatomy.head import Head
from ..anatomy.storage import reference_head
from .inputs import input_names


@dataclass(frozen=True, eq=False)
class Seen:
    """s poses and what the skin itself did in them: inputs (s, p), own (s, n, 3) mm; real (s,): not in a mirror.

    both (c, n, 3), image (c, n, 3) mm: own motion in poses that were simulated both ways round, and the mirror image of that
    in the mirrored poses
    """

    inputs: np.ndarray
    own: np.ndarray
    real: np.ndarray
    both: np.ndarray
    image: np.ndarray

    def alike(self, vertices: np.ndarray) -> float:
        """0..1: correlation of what ``vertices`` do with what they do in the mirror."""
        both, image = self.both[:, vertices].ravel(), self.image[:, vertices].ravel()
        size = np.sqrt((both @ both) * (image @ image))
        return float(np.clip(both @ image / size, 0, 1)) if size > 0 else 0.0


def opposite_vertices(head: Head) -> np.ndarray | None:
    """(n,) for each skin vertex the one that is its mirror image on the reference head; None for another mesh."""
    reference = reference_head().skin
    if reference.faces.shape != head.skin.faces.shape or (reference.faces != head.skin.faces).any():
        return None
    return cKDTree(reference.vertices).query(reference.vertices * (-1, 1, 1))[1]


def mirrored_inputs(muscle_names, inputs: np.ndarray) -> np.ndarray:
    """``inputs`` (s, p), seen in a mirror."""
    names = input_names(muscle_names)
    out = np.zeros_like(inputs)
    for k, name in enumerate(names):
        ((image, sign),) = mirrored({name: 1.0}).items()
        if image in names:
            out[:, names.index(image)] = sign * inputs[:, k]
    return out


def seen_twice(muscle_names, inputs: np.ndarray, own: np.ndarray, opposite: np.ndarray | None) -> Seen:
    """`Seen` of samples (s, p), (s, n, 3) and of their mirror images, where those are not simulated themselves.

    opposite : as `opposite_vertices` has it; None: no images
    """
    if opposite is None:
        none = own[:0]
        return Seen(inputs, own, np.ones(len(own), bool), none, none)
    turned = mirrored_inputs(muscle_names, inputs)
    place = {row.tobytes(): k for k, row in enumerate(_rounded(inputs))}
    found = np.array([place.get(row.tobytes(), -1) for row in _rounded(turned)])
    image = own[:, opposite] * np.array([-1, 1, 1], own.dtype)
    new, known = np.flatnonzero(found < 0), np.flatnonzero(found >= 0)
    return Seen(
        np.concatenate([inputs, turned[new]]),
        np.concatenate([own, image[new]]),
        np.arange(len(own) + len(new)) < len(own),
        own[found[known]],
        image[known],
    )


def _rounded(inputs):
    return np.round(inputs, 6) + 0.0  # no -0
