# SPDX-License-Identifier: GPL-3.0-or-later
"""The sphincter: draws the skin inside an ellipse together like a string bag (Waters 1986, 4.3.2, figure 16)."""

from dataclasses import dataclass

import numpy as np

from .elasticity import elastic


@dataclass(frozen=True, eq=False)
class Sphincter:
    """An ellipse in space (table 2).

    centre : (3,) mm, the point of contraction
    frame : (3, 3) rows: unit vectors along Lx, along Ly, and out of the face
    lengths : Lx and Ly, mm, the semi-axes
    spring : K, share of the way to the centre at full tension; elasticity : the power of 4.4
    pout : what the lips are pushed out at the centre, as a share of Ly (figure 25 and 5.10: pouting from the sphincter)
    """

    centre: np.ndarray
    frame: np.ndarray
    lengths: tuple[float, float]
    spring: float = 1.0
    elasticity: float = 1.0
    pout: float = 0.0

    def influence(self, points: np.ndarray) -> np.ndarray:
        """(n,) F = 1 - sqrt(x² + C y²) / Lx with C = Lx² / Ly² of ``points`` (n, 3); 0 on the ellipse and outside."""
        x, y = ((points - self.centre) @ self.frame[:2].T).T
        return elastic(ellipse(x, y, *self.lengths), self.elasticity)

    def way(self, points: np.ndarray, centre: np.ndarray | None = None, pouting: float = 1.0) -> np.ndarray:
        """(n, 3) mm from ``points`` (n, 3) to the centre in the plane of the ellipse, and out of it by the pout.

        centre : (3,) mm, where the centre has gone to; pouting : factor on the pout
        """
        centre = self.centre if centre is None else centre
        inside = (centre - points) @ self.frame[:2].T @ self.frame[:2]
        return inside + pouting * self.pout * self.lengths[1] * self.frame[2]

    def displacement(self, points: np.ndarray, tension: float) -> np.ndarray:
        """(n, 3) mm by which ``points`` (n, 3) move: K T F of the way to the centre, x' = F x and y' = F y."""
        return (self.spring * tension * self.influence(points))[:, None] * self.way(points)


def ellipse(x, y, semi_x: float, semi_y: float) -> np.ndarray:
    """F at (x, y) in the plane of the ellipse: 1 at its centre, 0 on it and beyond."""
    return np.clip(1 - np.sqrt(x**2 + (semi_x / semi_y) ** 2 * y**2) / semi_x, 0, 1)
