# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin seen from the jaw: what is left of a motion once the tissue has followed the mandible, in the turned frame.

Nodes are restored to the *posed rest*, where they would be if they only followed the jaw (Lee, Terzopoulos and Waters
1995, 3.8). Taken from there and turned along, what a muscle does to an open mouth is nearly what it does to a shut one.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..anatomy.head import Jaw
from ..tissue.jaw import jaw_transform


@dataclass(frozen=True, eq=False)
class JawFrame:
    """rest (n, 3) mm; share (n,) by which each vertex moves with the mandible; the hinge."""

    rest: np.ndarray
    share: np.ndarray
    jaw: Jaw

    def placed(self, own: np.ndarray, jaw) -> np.ndarray:
        """(n, 3) mm where the skin is, from its ``own`` motion (n, 3) in the frame of ``jaw`` (open, forward, side)."""
        rotation, translation = jaw_transform(self.jaw, *jaw)
        turn = (rotation - np.eye(3)).T
        out = self.rest + own
        rows, share = self._carried
        moved = out[rows]
        out[rows] = moved + share * (moved @ turn + translation)
        return out

    @cached_property
    def _carried(self) -> tuple[np.ndarray, np.ndarray]:
        """The vertices that move with the mandible at all, and their shares (k, 1)."""
        rows = np.flatnonzero(self.share)
        return rows, self.share[rows, None]

    def own(self, skin: np.ndarray, jaw) -> np.ndarray:
        """(n, 3) mm: the skin's own motion, of which `placed` makes ``skin`` (n, 3) again."""
        rotation, translation = jaw_transform(self.jaw, *jaw)
        share = self.share[:, None]
        frames = np.eye(3) + share[..., None] * (rotation - np.eye(3))
        return np.linalg.solve(frames, (skin - share * translation)[..., None])[..., 0] - self.rest
