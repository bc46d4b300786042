# SPDX-License-Identifier: GPL-3.0-or-later
"""The linear muscle: a vector that pulls the skin round it toward its fixed end (Waters 1986, 4.3.1, figure 15)."""

from dataclasses import dataclass

import numpy as np

from .elasticity import elastic, falling


@dataclass(frozen=True, eq=False)
class LinearMuscle:
    """A muscle vector and its zone of influence (table 1).

    head : (3,) mm, V1, the static node on the bone; tail : (3,) mm, V2, where it enters the skin
    zone : rad, half the angle of the zone at the head, up to half a turn
    fall_start, fall_finish : mm from the head, Rs and Rf: where the pull is greatest and where it ends
    spring : K, share of the way to the head at full tension; elasticity : the power of 4.4
    """

    head: np.ndarray
    tail: np.ndarray
    zone: float
    fall_start: float
    fall_finish: float
    spring: float = 1.0
    elasticity: float = 1.0

    def influence(self, points: np.ndarray) -> np.ndarray:
        """(n,) A R of ``points`` (n, 3), 0..1 and 0 outside the zone."""
        away = points - self.head
        distance = np.linalg.norm(away, axis=1)
        axis = self.tail - self.head
        cosine = away @ axis / np.maximum(distance * np.linalg.norm(axis), 1e-12)
        factor = angular(np.arccos(np.clip(cosine, -1, 1)), self.zone)
        return elastic(factor * radial(distance, self.fall_start, self.fall_finish), self.elasticity)

    def displacement(self, points: np.ndarray, tension: float) -> np.ndarray:
        """(n, 3) mm by which ``points`` (n, 3) move toward the head: P' - P = K T A R (V1 - P)."""
        return (self.spring * tension * self.influence(points))[:, None] * (self.head - points)


def angular(angle, zone: float) -> np.ndarray:
    """A: cos of the angle between the muscle and the way to a point, as a share of the ``zone`` (rad).

    For a zone of a right angle this is the cos(psi) of the thesis, and for any other the pull still ends at its border
    instead of breaking off there.
    """
    return falling(np.asarray(angle) / zone)


def radial(distance, fall_start: float, fall_finish: float) -> np.ndarray:
    """R: cos(1 - D / Rs) up to Rs, cos((D - Rs) / (Rf - Rs)) from there to Rf: 0 on the bone, 1 at Rs, 0 from Rf on."""
    distance = np.asarray(distance, float)
    within = falling(1 - distance / fall_start)
    beyond = falling((distance - fall_start) / (fall_finish - fall_start))
    return np.where(distance <= fall_start, within, beyond)
