# SPDX-License-Identifier: GPL-3.0-or-later
"""The surface where a function of space is none, in those cells of a grid that lie about points.

Surface nets, after Gibson 1998, "Constrained elastic surface nets": one vertex in each cell that the surface passes, one quad
for each side of cells that it crosses.
"""

import itertools

import numpy as np

#: The eight corners of a cell, and its twelve sides as pairs of them.
CORNERS = np.array(list(itertools.product((0, 1), repeat=3)))
SIDES = [(a, b) for a, b in itertools.combinations(range(8), 2) if np.abs(CORNERS[a] - CORNERS[b]).sum() == 1]
AXES = np.eye(3, dtype=np.int64)


class Grid:
    """The cells with sides of ``size`` that have any of ``points`` (n, 3) in them, and those beside them.

    corner : (c, 3) their corners; at : (m, 8) indices of those of each cell
    """

    def __init__(self, points: np.ndarray, size: float):
        self.size = size
        self.low = points.min(axis=0) - 2 * size
        places = np.floor((points - self.low) / size).astype(np.int64)
        self.span = places.max(axis=0) + 4
        cells = np.unique(self._key(places))
        for step in self._key(AXES):
            cells = np.unique(np.concatenate([cells - step, cells, cells + step]))
        keys = cells[:, None] + self._key(CORNERS)
        corners = np.unique(keys)
        self.cells, self.at = cells, np.searchsorted(corners, keys)
        self.corner = self.low + size * self._place(corners)

    def _key(self, places):
        return (places[..., 0] * self.span[1] + places[..., 1]) * self.span[2] + places[..., 2]

    def _place(self, keys):
        rest, z = np.divmod(keys, self.span[2])
        return np.stack([*np.divmod(rest, self.span[1]), z], axis=-1)

    def surface(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (v, 3) and quads (q, 4), counter-clockwise from where ``values`` (c,) at the corners are positive."""
        inside = values[self.at] < 0
        passed = inside.any(axis=1) & ~inside.all(axis=1)
        cells, at, inside = self.cells[passed], self.at[passed], inside[passed]
        crossing, count = np.zeros((len(cells), 3)), np.zeros(len(cells))
        for a, b in SIDES:
            crossed = inside[:, a] != inside[:, b]
            u, v = values[at[crossed][:, [a, b]]].T
            crossing[crossed] += CORNERS[a] + (u / (u - v))[:, None] * (CORNERS[b] - CORNERS[a])
            count[crossed] += 1
        vertices = self.low + self.size * (self._place(cells) + crossing / np.maximum(count, 1)[:, None])
        return vertices, self._quads(cells, inside)

    def _quads(self, cells, inside):
        """Each side of the grid belongs to the cell that it begins in; the other three about it lie behind that."""
        quads = [np.zeros((0, 4), np.int64)]
        for axis in range(3):
            u, v = AXES[[(axis + 1) % 3, (axis + 2) % 3]]
            end = int(np.flatnonzero((CORNERS == AXES[axis]).all(axis=1))[0])
            crossed = np.flatnonzero(inside[:, 0] != inside[:, end])
            key = cells[crossed, None] + self._key(np.stack([0 * u, -u, -u - v, -v]))
            index = np.minimum(np.searchsorted(cells, key), len(cells) - 1)
            whole = (cells[index] == key).all(axis=1)
            quad, outward = index[whole], inside[crossed[whole], 0]
            quads.append(np.where(outward[:, None], quad, quad[:, ::-1]))
        return np.concatenate(quads)
