# SPDX-License-Identifier: GPL-3.0-or-later
"""A motion as few shapes with a weight a frame: truncated singular value decomposition about the rest shape."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Principal:
    """``weights @ shapes`` gives the motion back.

    shapes : (k, n, 3) displacements, each scaled so that its weights reach 1 (or -1) at their largest
    weights : (f, k), -1..1
    error : largest distance of any vertex in any frame from where it should be, in the motion's unit
    """

    shapes: np.ndarray
    weights: np.ndarray
    error: float


def principal_shapes(motion: np.ndarray, tolerance: float) -> Principal:
    """The fewest shapes that keep every vertex of ``motion`` (f, n, 3) within ``tolerance`` in every frame.

    Displacements are from the rest shape, so all weights 0 is rest: nothing is centred. Rigid motions of a part need
    at most 12 shapes, for a rotated point is linear in the rotation's nine numbers.
    """
    frames, count = motion.shape[:2]
    flat = np.asarray(motion, dtype=np.float64).reshape(frames, -1)
    values, left = np.linalg.eigh(flat @ flat.T)
    left = left[:, ::-1][:, : min(frames, flat.shape[1])]
    right = left.T @ flat  # orthogonal rows, longest first
    few, many = -1, right.shape[0]
    while many - few > 1:  # the error falls with every shape taken, so the fewest are found by halving
        middle = (few + many) // 2
        few, many = (few, middle) if _error(flat, left, right, middle) <= tolerance else (middle, many)
    left, right = left[:, :many], right[:many]
    peak = np.abs(left).max(axis=0) if many else np.ones(0)
    sign = np.sign(left[np.abs(left).argmax(axis=0), np.arange(many)]) if many else np.ones(0)
    scale = peak * sign  # the largest weight is +1, whatever sign the eigenvectors came with
    return Principal(
        (right * scale[:, None]).reshape(many, count, 3), left / scale, float(_error(flat, left, right, many))
    )


def _error(flat, left, right, count) -> float:
    """Largest distance between the motion and its first ``count`` shapes."""
    rest = (flat - left[:, :count] @ right[:count]).reshape(len(flat), -1, 3)
    return float(np.sqrt(np.einsum("fni,fni->fn", rest, rest).max(initial=0.0)))
