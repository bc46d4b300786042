# SPDX-License-Identifier: GPL-3.0-or-later
"""Points of the skin as it is drawn, at which contact is looked for.

What is seen is the limit surface of the cage. Between vertices, and over folds, it lies elsewhere than the cage does: a
lip whose cage clears the teeth can still be drawn through them. So contact is between what is drawn and the rigid parts.
A point of the limit surface is a sum of vertices with fixed weights, so a push on it is a push on each, by its weight.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from ..mesh_subdivision import limit, subdivision
from .planes import Planes, empty_planes

#: Subdivisions of the cage that the points are taken from, and the mm that they are apart at rest.
LEVELS, SPACING = 2, 1.6
#: Vertices that a point depends on, at most: what a bicubic patch has. Others weigh nearly nothing.
WIDTH = 16


@dataclass(frozen=True, eq=False)
class Fan:
    """What is drawn round points: ``ring`` (r, n) sparse, the points beside them; face f (f,) round point ``owner`` lies
    between ring points ``ahead`` and ``behind``, counter-clockwise seen from outside."""

    ring: sparse.csr_matrix
    owner: np.ndarray
    ahead: np.ndarray
    behind: np.ndarray

    def __getitem__(self, chosen) -> "Fan":
        kept = chosen[self.owner]
        number = np.cumsum(chosen) - 1
        return Fan(self.ring, number[self.owner[kept]], self.ahead[kept], self.behind[kept])

    def normals(self, points, values) -> np.ndarray:
        """(k, 3) unit normals at ``points`` (k, 3) of the surface drawn of the vertices ``values`` (n, 3)."""
        ring, middle = self.ring @ values, points[self.owner]
        cross = np.cross(ring[self.ahead] - middle, ring[self.behind] - middle)
        out = np.stack([np.bincount(self.owner, cross[:, axis], len(points)) for axis in range(3)], axis=1)
        return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)


@dataclass(frozen=True, eq=False)
class Samples:
    """Points of the drawn surface: rows (k, n) sparse; the same as node (k, w) and weight (k, w), padded with 0; what is
    round them, if that was asked for."""

    rows: sparse.csr_matrix
    node: np.ndarray
    weight: np.ndarray
    fan: Fan | None = None

    def __len__(self):
        return len(self.node)

    def __getitem__(self, chosen) -> "Samples":
        """Those ``chosen``; with fans by (k,) bool."""
        fan = None if self.fan is None else self.fan[chosen]
        return Samples(self.rows[chosen], self.node[chosen], self.weight[chosen], fan)

    def at(self, values) -> np.ndarray:
        """(k, 3) what the vertices' ``values`` (n, 3) are at the points."""
        return self.rows @ values

    def along(self, which, normal) -> tuple[np.ndarray, np.ndarray]:
        """Columns and values (c, 3 w) of the rows that give the coordinates of points ``which`` (c,) along ``normal``
        (c, 3), of node-major positions."""
        value = self.weight[which][:, None] * normal[:, :, None]
        return self._columns[which], value.reshape(len(which), 3 * self.node.shape[1])

    @cached_property
    def _columns(self) -> np.ndarray:
        """(k, 3 w) columns of `along`, axis by axis."""
        return (
            (self.node[:, None] * 3 + np.arange(3)[:, None]).reshape(len(self), 3 * self.node.shape[1]).astype(np.int32)
        )


def samples_of(rows: sparse.csr_matrix) -> Samples:
    """The points with the weights ``rows`` (k, n)."""
    count = np.diff(rows.indptr)
    width = int(min(count.max(initial=1), WIDTH))
    point = np.repeat(np.arange(rows.shape[0]), count)
    order = np.lexsort((-rows.data, point))
    place = np.arange(len(order)) - np.repeat(rows.indptr[:-1], count)
    kept = place < width
    node, weight = np.zeros((rows.shape[0], width), int), np.zeros((rows.shape[0], width))
    node[point[kept], place[kept]] = rows.indices[order][kept]
    weight[point[kept], place[kept]] = rows.data[order][kept]
    weight /= np.maximum(weight.sum(axis=1, keepdims=True), 1e-9)
    flat = (weight.ravel(), node.ravel(), np.arange(0, node.size + 1, width))
    return Samples(sparse.csr_matrix(flat, rows.shape), node, weight)


def planes_of(pieces, n: int) -> Planes:
    """`Planes` of all ``pieces``: columns (c, w), values (c, w) and level (c,) each; n: number of vertices."""
    pieces = [piece for piece in pieces if len(piece[2])]
    none = empty_planes()
    if not pieces:
        return none
    column, value, level = (np.concatenate([piece[k].ravel() for piece in pieces]) for k in range(3))
    width = np.concatenate([np.full(len(piece[2]), piece[0].shape[1]) for piece in pieces])
    start = np.concatenate([[0], np.cumsum(width)]).astype(np.int32)
    rows = sparse.csr_matrix((value, column, start), (len(level), 3 * n))
    return Planes(none.node, none.normal, none.level, none.partner, rows, level)


def drawn_samples(
    faces: np.ndarray, vertices: np.ndarray, chosen: np.ndarray, spacing: float = SPACING, fans: bool = False
) -> Samples:
    """`Samples` (k) of the surface drawn of the faces with a vertex in ``chosen``, about ``spacing`` mm apart.

    faces (m, 4), vertices (n, 3) mm at rest, chosen (n,) bool; fans: with the `Fan` of the points. First come the chosen
    vertices' own points.
    """
    n = len(vertices)
    if not chosen.any():
        return samples_of(sparse.csr_matrix((0, n)))
    real = faces >= 0
    used = chosen.copy()
    for _ in range(3):  # the rings that the limit over the chosen faces depends on
        used[faces[(used[faces] & real).any(axis=1)].ravel()] = True
    near = faces[((used[faces] | ~real).all(axis=1)) & (used[faces] & real).any(axis=1)]
    keep = np.unique(near[near >= 0])
    local = np.where(near >= 0, np.searchsorted(keep, near), -1)
    fine, quads, parent = subdivision(local, len(keep), LEVELS)
    rows = (limit(quads, fine.shape[0]) @ fine).tocsr()
    own = (chosen[near] & (near >= 0)).any(axis=1)
    points = np.unique(quads[own[parent]])
    at = rows[points] @ vertices[keep]
    corner = points < len(keep)
    corner[corner] = chosen[keep[points[corner]]]
    # one point in each cell of a grid that is the same on both sides, a vertex's own rather than one between, and of these
    # the one nearest to the middle of the cell
    near = at / spacing
    near[:, 0] = np.abs(near[:, 0])
    cell = np.floor(near).astype(np.int64)
    off = np.round(np.linalg.norm(near - cell - 0.5, axis=1), 5)
    cell[:, 0] = np.where(at[:, 0] < 0, -1 - cell[:, 0], cell[:, 0])
    cell[near[:, 0] < 1e-6, 0] = cell[:, 0].max(initial=0) + 1  # the plane of symmetry is on neither side
    order = np.lexsort((off, ~corner))
    _, first = np.unique(cell[order], axis=0, return_index=True)
    picked = corner.copy()
    picked[order[first]] = True
    picked = np.concatenate([points[corner], points[picked & ~corner]])

    def of_all(some):
        some = rows[some].tocoo()
        return sparse.csr_matrix((some.data, (some.row, keep[some.col])), (some.shape[0], n))

    samples = samples_of(of_all(picked))
    return replace(samples, fan=_fan_of(quads, picked, of_all)) if fans else samples


def _fan_of(quads, picked, rows_of) -> Fan:
    """The `Fan` of the points ``picked`` (k,) of a mesh of ``quads``; rows_of: points -> their rows."""
    number = np.full(quads.max() + 1, -1)
    number[picked] = np.arange(len(picked))
    face, corner = np.nonzero(number[quads] >= 0)
    ahead, behind = (quads[face, (corner + step) % 4] for step in (1, 3))
    ring, place = np.unique(np.concatenate([ahead, behind]), return_inverse=True)
    return Fan(rows_of(ring), number[quads[face, corner]], *place.reshape(2, -1))
