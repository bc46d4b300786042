# SPDX-License-Identifier: GPL-3.0-or-later
"""Lips that stick together: springs between points of the two lips that touch at rest.

Wet lips part late and from the middle outwards; and lips can be held together over an open jaw (AU 8). A spring a pair
keeps the offset that the two points have at rest, as firmly as the control asks.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..anatomy.head import Head
from ..mesh import vertex_normals
from .geometry import short_diagonals
from .layers import Layers

TOUCHING = 3.0  # mm between points of the lips that count as touching at rest


@dataclass(frozen=True, eq=False)
class Seal:
    """Pairs of skin columns ``upper``, ``lower`` (p,), the ``offset`` (p, 3) mm from the one to the other at rest and
    the ``area`` (p,) mm² of lip each stands for."""

    upper: np.ndarray
    lower: np.ndarray
    offset: np.ndarray
    area: np.ndarray


def build_seal(head: Head, layers: Layers) -> Seal:
    """The `Seal` of ``head``: each point of a lip that faces the other, with the nearest point there."""
    n = len(layers.area)
    skin = head.skin.vertices
    normal = vertex_normals(skin, short_diagonals(skin, head.skin.faces))
    zero = np.zeros(n)
    up, low = (
        np.flatnonzero((np.asarray(head.groups.get(name, zero)) > 0.5) & layers.free[:n])
        for name in ("lip_upper", "lip_lower")
    )
    if not len(up) or not len(low):
        none = np.zeros(0, int)
        return Seal(none, none, np.zeros((0, 3)), np.zeros(0))
    pairs = []
    for own, other, flip in ((up, low, False), (low, up, True)):
        distance, near = cKDTree(skin[other]).query(skin[own])
        mate = other[near]
        facing = np.einsum("ij,ij->i", normal[own], normal[mate]) < -0.2
        keep = facing & (distance < TOUCHING)
        pair = np.stack([own[keep], mate[keep]], axis=1)
        pairs.append(pair[:, ::-1] if flip else pair)
    upper, lower = np.unique(np.concatenate(pairs), axis=0).T
    return Seal(upper, lower, skin[lower] - skin[upper], np.sqrt(layers.area[upper] * layers.area[lower]))


def seal_energy(seal: Seal, stiffness: float, positions: np.ndarray) -> tuple[float, np.ndarray]:
    """Energy and force per pair (p, 3), pulling the lower point; ``stiffness`` per mm²."""
    off = positions[seal.lower] - positions[seal.upper] - seal.offset
    pulled = (stiffness * seal.area)[:, None] * off
    return 0.5 * float(np.einsum("ij,ij->", pulled, off)), pulled
