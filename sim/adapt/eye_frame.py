# SPDX-License-Identifier: GPL-3.0-or-later
"""An eye as a scan is looked at there: from the front, along and across the straight way from its inner to its outer corner."""

from dataclasses import dataclass

import numpy as np

from ..relax.mouth_gap import DEEP, depths
from .closest import Surface


@dataclass(frozen=True, eq=False)
class EyeFrame:
    """inner (3,) mm : the inner corner; way (3,) mm : from there to the outer one; forward, up, along (3,) : unit vectors at
    right angles, out of the face, upward across the way, toward the outer corner; scale : mm on the scan per mm of the
    reference.
    """

    inner: np.ndarray
    way: np.ndarray
    forward: np.ndarray
    up: np.ndarray
    along: np.ndarray
    scale: float

    def lines(self, shares, heights) -> np.ndarray:
        """Places (c, r, 3) mm at ``shares`` (c,) of the way and ``heights`` (r,) above it, in mm of the reference."""
        return (self.inner + shares[:, None] * self.way)[:, None] + self.scale * heights[:, None] * self.up

    @property
    def middle(self) -> np.ndarray:
        """(3,) mm midway between the corners."""
        return self.inner + self.way / 2

    def grid(self, x, y) -> np.ndarray:
        """Places (r, c, 3) mm at ``x`` (c,) along the eye from its middle and ``y`` (r,) above it, in mm of the reference."""
        return self.middle + self.scale * (x[:, None] * self.along + y[:, None, None] * self.up)

    def depth(self, target: Surface, places, deep: float = DEEP) -> np.ndarray:
        """How far (...) the scan lies behind ``places`` (..., 3), in mm of the reference; NaN where it has nothing less than
        ``deep`` mm off."""
        return depths(target, places.reshape(-1, 3), self.forward, deep).reshape(places.shape[:-1]) / self.scale

    def behind(self, places, depth) -> np.ndarray:
        """Points (..., 3) mm of the scan that lie ``depth`` (...) behind ``places`` (..., 3)."""
        return places - self.scale * np.asarray(depth)[..., None] * self.forward

    def share(self, place) -> float:
        """Share of the way at which a ``place`` (3,) lies."""
        return float((place - self.inner) @ self.way / (self.way @ self.way))


def eye_frame(marks, side: str, matrix) -> EyeFrame:
    """The `EyeFrame` of the eye on ``side``.

    marks : name -> (3,) mm, about where ``en`` and ``ex`` lie; matrix (3, 3) turns and scales the reference into the scan
    """
    inner, outer = marks[f"en_{side}"], marks[f"ex_{side}"]
    forward = -matrix[:, 1] / np.linalg.norm(matrix[:, 1])
    up = np.cross(forward, outer - inner)
    up *= np.sign(up @ matrix[:, 2]) / np.linalg.norm(up)
    along = np.cross(up, forward)
    along *= np.sign(along @ (outer - inner))
    return EyeFrame(inner, outer - inner, forward, up, along, float(np.cbrt(np.linalg.det(matrix))))
