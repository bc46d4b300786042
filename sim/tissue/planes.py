# SPDX-License-Identifier: GPL-3.0-or-later
"""Contacts as points against planes: their energy, and projection out of what is left."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse


@dataclass(frozen=True, eq=False)
class Planes:
    """Active contacts: node (c,), normal (c, 3), level (c,): node · normal must not fall under level.

    partner (c,) node that carries the plane or -1 (then the plane is fixed); offset for partnered ones.
    rows (r, 3 m) sparse, or None, and row_level (r,): the same for points between nodes; rows @ positions, node-major and
    of the first m nodes, must not fall under row_level.
    """

    node: np.ndarray
    normal: np.ndarray
    level: np.ndarray
    partner: np.ndarray
    rows: Any = None
    row_level: np.ndarray | None = None

    @cached_property
    def pushed(self):
        """``rows``, transposed: what a push on each point is on its nodes."""
        return self.rows.T


def empty_planes() -> Planes:
    """No contact."""
    return Planes(np.zeros(0, int), np.zeros((0, 3)), np.zeros(0), np.zeros(0, int))


def joined(*planes: Planes) -> Planes:
    """All of them in one table."""
    tables = (np.concatenate([getattr(p, f) for p in planes]) for f in ("node", "normal", "level", "partner"))
    between = [p for p in planes if p.rows is not None]
    if not between:
        return Planes(*tables)
    rows = between[0].rows if len(between) == 1 else sparse.vstack([p.rows for p in between], format="csr")
    return Planes(*tables, rows, np.concatenate([p.row_level for p in between]))


def touching(node, normal, level) -> Planes:
    """Contacts of nodes (c,) with fixed planes only."""
    return Planes(node, normal, level, np.full(len(node), -1))


def row_depths(planes: Planes, positions) -> np.ndarray:
    """(r,) mm of penetration of the points between nodes, 0 where apart."""
    if planes.rows is None:
        return np.zeros(0)
    return np.maximum(planes.row_level - planes.rows @ positions[: planes.rows.shape[1] // 3].ravel(), 0)


def depths(planes: Planes, positions) -> np.ndarray:
    """(c,) mm of penetration, 0 where apart."""
    here = np.einsum("ij,ij->i", positions[planes.node], planes.normal)
    paired = planes.partner >= 0
    if paired.any():
        here[paired] -= np.einsum("ij,ij->i", positions[planes.partner[paired]], planes.normal[paired])
    return np.maximum(planes.level - here, 0)


def contact_pushes(planes: Planes, positions, stiffness: float):
    """Energy ½ k Σ depth², the nodes (k,) that touch and its gradient there (k, 3); a node may come more than once."""
    depth = depths(planes, positions)
    hit = np.flatnonzero(depth > 0)
    if not len(hit):
        return 0.0, hit, np.zeros((0, 3))
    push = -stiffness * depth[hit, None] * planes.normal[hit]
    pair = planes.partner[hit]
    both = pair >= 0
    node = np.concatenate([planes.node[hit], pair[both]])
    return 0.5 * stiffness * float(depth @ depth), node, np.concatenate([push, -push[both]])


def contact_energy(planes: Planes, positions, stiffness: float) -> tuple[float, np.ndarray]:
    """Energy ½ k Σ depth² and its gradient over all nodes."""
    energy, node, push = contact_pushes(planes, positions, stiffness)
    gradient = [np.bincount(node, push[:, axis], minlength=len(positions)) for axis in range(3)]
    return energy, np.stack(gradient, axis=1)


def row_energy(planes: Planes, positions, stiffness: float) -> tuple[float, np.ndarray | None]:
    """Energy ½ k Σ depth² of the points between nodes, and its gradient over the first m nodes (m, 3), if there is any."""
    depth = row_depths(planes, positions)
    if not depth.any():
        return 0.0, None
    return 0.5 * stiffness * float(depth @ depth), (planes.pushed @ (-stiffness * depth)).reshape(-1, 3)


def project(planes: Planes, positions, rounds: int = 2) -> np.ndarray:
    """Positions with what is left of penetration removed; partners share the way."""
    out = positions.copy()
    for _ in range(rounds):
        depth = depths(planes, out)
        hit = np.flatnonzero(depth > 1e-6)
        if not len(hit):
            break
        pair = planes.partner[hit]
        part = np.where(pair >= 0, 0.5, 1.0)
        push = (part * depth[hit])[:, None] * planes.normal[hit]
        both = pair >= 0
        nodes = np.concatenate([planes.node[hit], pair[both]])
        moves = np.concatenate([push, -push[both]])
        count = np.bincount(nodes, minlength=len(out))
        for axis in range(3):
            out[:, axis] += np.bincount(nodes, moves[:, axis], minlength=len(out)) / np.maximum(count, 1)
    return out
