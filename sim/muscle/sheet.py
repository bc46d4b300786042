# SPDX-License-Identifier: GPL-3.0-or-later
"""The sheet: almost parallel fibres that shorten side by side (Waters 1986, 4.3.3, figure 17)."""

from dataclasses import dataclass

import numpy as np

from .elasticity import elastic, falling


@dataclass(frozen=True, eq=False)
class SheetMuscle:
    """The central fibre of a sheet (table 3).

    head : (3,) mm on the bone; tail : (3,) mm where the fibres end in the skin; VL long
    reach : Rf, mm to either side of the central fibre; extension : Vf, mm beyond the tail over which the pull ends
    spring : K, share of its length that the sheet loses at full tension; elasticity : the power of 4.4
    """

    head: np.ndarray
    tail: np.ndarray
    reach: float
    extension: float
    spring: float = 1.0
    elasticity: float = 1.0

    @property
    def length(self) -> float:
        """VL, mm."""
        return float(np.linalg.norm(self.tail - self.head))

    @property
    def direction(self) -> np.ndarray:
        """(3,) unit vector of the pull, toward the head."""
        return (self.head - self.tail) / self.length

    def influence(self, points: np.ndarray) -> np.ndarray:
        """(n,) D of ``points`` (n, 3): across the fibres cos(Lt / Rf), and beyond the tail cos((Vi - VL) / Vf) of it.

        The thesis prints cos(1 - Lt / Rf), which read as the share of a right angle would be 0 on the central fibre; its
        figure has the peak there and nothing at Rf.
        """
        along, across = self._coordinates(points)
        beyond = falling((along - self.length) / self.extension)
        return elastic(falling(across / self.reach) * beyond, self.elasticity) * (along > 0)

    def displacement(self, points: np.ndarray, tension: float) -> np.ndarray:
        """(n, 3) mm by which ``points`` (n, 3) move along the fibres: x' in proportion to K, D and x, the way from the
        root, as in a sheet that shortens evenly; beyond the tail all hangs on its end."""
        along, _ = self._coordinates(points)
        amount = self.spring * tension * self.influence(points) * np.clip(along, 0, self.length)
        return amount[:, None] * self.direction

    def _coordinates(self, points):
        """Vi (n,) mm along the fibre from the root and Lt (n,) mm beside it."""
        away = points - self.head
        along = -away @ self.direction
        beside = away + along[:, None] * self.direction
        return along, np.linalg.norm(beside, axis=1)
