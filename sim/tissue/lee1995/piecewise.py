# SPDX-License-Identifier: GPL-3.0-or-later
"""Piecewise linear muscle forces: Lee, Terzopoulos and Waters 1995, 3.5, figure 7(b).

A chain of N segments from the free end m^1 to the fixed end m^(N+1). A node belongs to the segment nearest to it; its length
ratio counts what is left of that segment and all segments after it. With N = 1 it is the linear muscle of 3.4.
"""

import numpy as np

from ..muscle_field import theta_1, theta_2
from .muscles import DEPTH, width


def nearest_segment(points: np.ndarray, chain: np.ndarray, normals: np.ndarray):
    """Segment (k,), omega (k,) and depth p · n (k,) of ``points`` (k, 3) along ``chain`` (N + 1, 3).

    normals : (N, 3) n_{j,l} of each segment
    """
    found = [width(points, a, b, n) for a, b, n in zip(chain[:-1], chain[1:], normals, strict=True)]
    omega, above = (np.stack(x) for x in zip(*found, strict=True))
    segment = np.argmin(omega**2 + above**2, axis=0)
    row = np.arange(len(points))
    return segment, omega[segment, row], above[segment, row]


def length_ratio(points: np.ndarray, chain: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """(k,) epsilon of 3.5: the way along the chain from each point on its segment (k,) to the fixed end, over the whole."""
    way = np.diff(chain, axis=0)
    length = np.linalg.norm(way, axis=1)
    after = np.concatenate([np.cumsum(length[::-1])[::-1][1:], [0.0]])
    unit = way / length[:, None]
    here = np.einsum("ij,ij->i", chain[segment + 1] - points, unit[segment])
    return (here + after[segment]) / length.sum()


def nearness(points: np.ndarray, chain: np.ndarray, normals: np.ndarray, muscle_width: float) -> np.ndarray:
    """(k,) Theta_2 alone: how much of a muscle's width each of ``points`` (k, 3) has, wherever along it."""
    _, omega, above = nearest_segment(points, chain, normals)
    return theta_2(omega / muscle_width) * (np.abs(above) < DEPTH)


def muscle_forces(points: np.ndarray, chain: np.ndarray, normals: np.ndarray, muscle_width: float) -> np.ndarray:
    """(k, 3) Theta_1 Theta_2 m_{j,l} on fascia at ``points`` (k, 3), along the segment nearest to each."""
    segment, omega, above = nearest_segment(points, chain, normals)
    epsilon = length_ratio(points, chain, segment)
    scale = theta_1(epsilon) * theta_2(omega / muscle_width) * (np.abs(above) < DEPTH)
    way = np.diff(chain, axis=0)
    return scale[:, None] * (way / np.linalg.norm(way, axis=1, keepdims=True))[segment]
