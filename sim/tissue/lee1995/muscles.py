# SPDX-License-Identifier: GPL-3.0-or-later
"""Linear muscle forces: Lee, Terzopoulos and Waters 1995, 3.4, figures 7(a) and 8.

A muscle is a vector from its free end m^A in the fascia to its fixed end m^F in the bone, with m_j its direction: the only
reading in which epsilon is 0 "at the root of the muscle fibre in the bone", where the force is to vanish, and in which the
force Theta_1 Theta_2 m_j contracts the muscle. The scaling functions are drawn in figure 8 without a formula; smooth
ones of that shape are `muscle_field.theta_1` and `theta_2`.
"""

import numpy as np

from ..muscle_field import theta_1, theta_2

#: "Within a predetermined distance": fascia farther above or below the vector than this, mm, is of another layer.
DEPTH = 16.0


def length_ratio(points: np.ndarray, free_end: np.ndarray, fixed_end: np.ndarray) -> np.ndarray:
    """(k,) epsilon = ((m^F - x) · m_j) / ‖m^A - m^F‖ of ``points`` (k, 3): 0 at the fixed end, 1 at the free one."""
    way = fixed_end - free_end
    return (fixed_end - points) @ way / (way @ way)


def width(points: np.ndarray, free_end: np.ndarray, fixed_end: np.ndarray, normal: np.ndarray):
    """omega (k,) = ‖p - (p · n_j) n_j‖, how far beside the muscle, and p · n_j (k,), how far above it, mm.

    p is the perpendicular from each point to the muscle; beyond an end it is the way to that end.
    normal : (3,) unit vector n_j out of the muscle's plane
    """
    way = fixed_end - free_end
    t = np.clip((points - free_end) @ way / (way @ way), 0, 1)
    p = free_end + t[:, None] * way - points
    above = p @ normal
    return np.linalg.norm(p - above[:, None] * normal, axis=1), above


def muscle_forces(
    points: np.ndarray, free_end: np.ndarray, fixed_end: np.ndarray, normal: np.ndarray, muscle_width: float
) -> np.ndarray:
    """(k, 3) Theta_1(epsilon) Theta_2(omega / w_j) m_j on fascia at ``points`` (k, 3)."""
    epsilon = length_ratio(points, free_end, fixed_end)
    omega, above = width(points, free_end, fixed_end, normal)
    scale = theta_1(epsilon) * theta_2(omega / muscle_width) * (np.abs(above) < DEPTH)
    way = fixed_end - free_end
    return scale[:, None] * (way / np.linalg.norm(way))
