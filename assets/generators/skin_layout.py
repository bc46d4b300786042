# SPDX-License-Identifier: GPL-3.0-or-later
"""Connectivity of the reference skin: a cylinder of quads with holes refilled by concentric rings.

Columns ``u`` run around the head from the front midline (u = 0) to the back midline (u = `HALF`), positive on the
subject's left; rows ``v`` run from the crown down to the bust's edge. A square patch closes the crown. Rectangular
blocks of cells are taken out for mouth, eyes, nostrils and ears; every hole is refilled by rings with as many vertices
as the block has on its perimeter, so loops are concentric. Behind the face and on the neck every third line is enough:
`skin_thinning` joins them to the others with quads only, so that no vertex has more than five neighbours.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from .skin_thinning import COLUMN_THINNINGS, ROW_THINNINGS

#: Columns from the front to the back midline.
HALF = 24

#: Rows of vertices; row 0 borders the crown patch, the last is the open edge of the bust.
ROWS = 35

#: Cells along one side of the crown patch.
CROWN = 8


@dataclass(frozen=True)
class Block:
    """Cells removed between columns u0..u1 and rows v0..v1, the rings that refill them, and the final patch.

    ``patch`` = (first ring vertex, cells down, cells across) of the grid that closes the last ring. The vertices of ring
    ``late`` are numbered after all others: tables made before there was this ring keep their order.
    """

    u0: int
    u1: int
    v0: int
    v1: int
    rings: int
    patch: tuple[int, int, int]
    late: int | None = None

    @property
    def perimeter(self) -> list[tuple[int, int]]:
        """(u, v) counter-clockwise seen from outside, from the top corner at u0: down, across, up, back."""
        down = [(self.u0, v) for v in range(self.v0, self.v1)]
        across = [(u, self.v1) for u in range(self.u0, self.u1)]
        up = [(self.u1, v) for v in range(self.v1, self.v0, -1)]
        back = [(u, self.v0) for u in range(self.u1, self.u0, -1)]
        return down + across + up + back


#: Blocks of the midline and of the left side (the right side mirrors them).
BLOCKS = {
    "mouth": Block(-5, 5, 16, 22, 11, (2, 2, 14), late=10),
    "eye": Block(3, 11, 5, 9, 8, (1, 2, 10)),
    "nostril": Block(1, 3, 13, 15, 3, (0, 2, 2)),
    "ear": Block(15, 19, 7, 15, 7, (-1, 10, 2)),
}


def _row(grid: np.ndarray, v: int) -> np.ndarray:
    inner = {u for t in COLUMN_THINNINGS for u, row in t.inner if row == v}
    return np.array([grid[v, u] for u in range(2 * HALF) if grid[v, u] >= 0 and min(u, 2 * HALF - u) not in inner])


@dataclass(frozen=True, eq=False)
class Layout:
    """The finished connectivity.

    Attributes
    ----------
    count : number of vertices
    faces : (m, 4) int32, counter-clockwise seen from outside; the second half mirrors the first
    mirror : (count,) int32, the vertex on the other side
    grid : (ROWS, 2 * HALF) int32, vertex at column u modulo 2 * HALF; -1 where a block or a thinning took it away
    crown : (CROWN + 1, CROWN + 1) int32, [left-ward, back-ward]
    rings : hole name (``mouth``, ``eye_l``, ...) -> (rings + 1, perimeter) int32; ring 0 is the block's perimeter
    patches : hole name -> (down + 1, across + 1) int32, border included
    """

    count: int
    faces: np.ndarray
    mirror: np.ndarray
    grid: np.ndarray
    crown: np.ndarray
    rings: dict[str, np.ndarray]
    patches: dict[str, np.ndarray]

    @property
    def left(self) -> np.ndarray:
        """(k,) vertices of the left side and the midline: the smaller index of each mirror pair."""
        return np.flatnonzero(np.arange(self.count) <= self.mirror)

    @property
    def midline(self) -> np.ndarray:
        """(k,) vertices that are their own mirror."""
        return np.flatnonzero(np.arange(self.count) == self.mirror)

    def row(self, v: int) -> np.ndarray:
        """(k,) vertices of a row, round from the front midline by the left; without the inner ones of a thinning."""
        return _row(self.grid, v)

    @property
    def edge(self) -> np.ndarray:
        """(k,) vertices of the bust's open edge, round from the front midline by the left."""
        return self.row(-1 % ROWS)

    def places(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Vertex, column (signed) and row of all grid vertices, each (k,); inner ones of a thinning lie half a cell off."""
        v, u = np.nonzero(self.grid >= 0)
        column, row = np.where(u > HALF, u - 2 * HALF, u).astype(float), v.astype(float)
        for t in ROW_THINNINGS:
            for side in (1, -1):
                column[(column == side * (t.u + 1)) & (row > t.v) & (row < t.v + 3)] -= 0.5 * side
        for t in COLUMN_THINNINGS:
            row[(row == t.v + t.way) & (abs(column) > t.u) & (abs(column) < t.u + 3)] -= 0.5 * t.way
        return self.grid[v, u], column, row


class _Maker:
    """Vertices as they are made: a left one first, its mirror right after it."""

    def __init__(self):
        self.mirror: list[int] = []

    def pair(self) -> tuple[int, int]:
        first = len(self.mirror)
        self.mirror += [first + 1, first]
        return first, first + 1

    def single(self) -> int:
        self.mirror.append(len(self.mirror))
        return len(self.mirror) - 1

    def grid(self) -> np.ndarray:
        gone = np.zeros((ROWS, HALF + 1), dtype=bool)
        for block in BLOCKS.values():
            gone[block.v0 + 1 : block.v1, max(block.u0 + 1, 0) : block.u1] = True
        for t in (*ROW_THINNINGS, *COLUMN_THINNINGS):
            for u, v in t.removed(HALF, ROWS):
                gone[v, u] = True
        grid = np.full((ROWS, 2 * HALF), -1, dtype=np.int32)
        for v, u in np.argwhere(~gone):
            if u in (0, HALF):
                grid[v, u] = self.single()
            else:
                grid[v, u], grid[v, -u] = self.pair()
        return grid

    def table(self, rows: int, columns: int, border: dict) -> np.ndarray:
        """A vertex table symmetric about its middle column, with given border vertices."""
        out = np.full((rows, columns), -1, dtype=np.int32)
        for (row, col), vertex in border.items():
            out[row, col] = vertex
        for row in range(rows):
            for col in range((columns + 1) // 2):
                if out[row, col] < 0:
                    if col == columns - 1 - col:
                        out[row, col] = self.single()
                    else:
                        out[row, columns - 1 - col], out[row, col] = self.pair()
        return out

    def crown(self, row: list[int]) -> np.ndarray:
        """The patch [back-ward, right to left] within the topmost row, given all round from the front by the left."""
        border, half, all_round = {}, CROWN // 2, 4 * CROWN
        for k, vertex in enumerate(row):
            signed = k if k <= all_round // 2 else k - all_round
            if abs(signed) <= half:
                spot = (0, signed + half)
            elif abs(signed) <= half + CROWN:
                spot = (abs(signed) - half, CROWN if signed > 0 else 0)
            else:
                away = all_round // 2 - abs(signed)
                spot = (CROWN, half + away * (1 if signed > 0 else -1))
            border[spot] = int(vertex)
        return self.table(CROWN + 1, CROWN + 1, border)

    def mouth(self, block: Block, grid: np.ndarray):
        """Rings and patch of a block on the midline; the late ring's vertices are still to be made (-1)."""
        around, size = block.perimeter, len(block.perimeter)
        levels = np.full((block.rings + 1, size), -1, dtype=np.int32)
        levels[0] = [grid[v, u % (2 * HALF)] for u, v in around]
        for ring in range(1, block.rings + 1):
            if ring != block.late:
                levels[ring] = self.ring(block)
        start, down, across = block.patch
        border = {s: levels[-1, (start + i) % size] for i, s in enumerate(_perimeter_of(down, across))}
        return levels, self.table(down + 1, across + 1, border)

    def ring(self, block: Block) -> np.ndarray:
        """One ring of a block on the midline."""
        around, size = block.perimeter, len(block.perimeter)
        out = np.empty(size, dtype=np.int32)
        for i, (u, _) in enumerate(around):
            if u == 0:
                out[i] = self.single()
            elif u > 0:
                out[i], out[(2 * (block.v1 - block.v0) + block.u1 - block.u0 - i) % size] = self.pair()
        return out

    def both(self, block: Block, grid: np.ndarray):
        """Rings (2, r, k) and patches (2, ...) of a block of the left side and its mirror image."""
        around, size = block.perimeter, len(block.perimeter)
        levels = np.empty((2, block.rings + 1, size), dtype=np.int32)
        levels[:, 0] = [[grid[v, u] for u, v in around], [grid[v, -u] for u, v in around]]
        for ring in range(1, block.rings + 1):
            for i in range(size):
                levels[:, ring, i] = self.pair()
        start, down, across = block.patch
        fill = np.full((2, down + 1, across + 1), -1, dtype=np.int32)
        for i, spot in enumerate(_perimeter_of(down, across)):
            fill[(slice(None), *spot)] = levels[:, -1, (start + i) % size]
        for row, col in np.argwhere(fill[0] < 0):
            fill[:, row, col] = self.pair()
        return levels, fill


def _cells(table: np.ndarray) -> np.ndarray:
    """(m, 4) quads of a vertex table [row downward, column rightward], counter-clockwise."""
    a, b, c, d = table[:-1, :-1], table[1:, :-1], table[1:, 1:], table[:-1, 1:]
    return np.stack([a, b, c, d], axis=-1).reshape(-1, 4)


def _perimeter_of(down: int, across: int) -> list[tuple[int, int]]:
    return [(v, u) for u, v in Block(0, across, 0, down, 0, (0, 0, 0)).perimeter]


def _grid_faces(grid: np.ndarray) -> np.ndarray:
    """(m, 4) quads of the left half of the grid around the blocks, with the thinnings' own."""
    half = grid[:, : HALF + 1]
    cells = _cells(half).reshape(ROWS - 1, HALF, 4)
    dead = np.zeros((ROWS - 1, HALF), dtype=bool)
    for block in BLOCKS.values():
        dead[block.v0 : block.v1, max(block.u0, 0) : block.u1] = True
    own = []
    for t in (*ROW_THINNINGS, *COLUMN_THINNINGS):
        for u, v in t.dead(HALF, ROWS):
            dead[v, u] = True
        own += [[half[v, u] for u, v in face] for face in t.faces(HALF, ROWS)]
    faces = np.concatenate([cells[~dead], np.array(own, dtype=np.int32)])
    assert (faces >= 0).all()
    return faces


@cache
def skin_layout() -> Layout:
    """The connectivity of the reference skin; every call gives the same."""
    make = _Maker()
    grid = make.grid()
    crown = make.crown(_row(grid, 0))
    faces = [_grid_faces(grid), _cells(crown)[:, ::-1]]
    rings, patches = {}, {}
    for name, block in BLOCKS.items():
        if name == "mouth":
            rings[name], patches[name] = make.mouth(block, grid)
        else:
            levels, fill = make.both(block, grid)
            for side, s in enumerate(("_l", "_r")):
                rings[name + s], patches[name + s] = levels[side], fill[side]
    rings["mouth"][BLOCKS["mouth"].late] = make.ring(BLOCKS["mouth"])
    for name in BLOCKS:
        left = name if name == "mouth" else name + "_l"
        closed = np.concatenate([rings[left], rings[left][:, :1]], axis=1)
        quads = np.stack([closed[:-1, :-1], closed[:-1, 1:], closed[1:, 1:], closed[1:, :-1]], axis=-1).reshape(-1, 4)
        faces += [quads, _cells(patches[left])]
    mirror = np.array(make.mirror, dtype=np.int32)
    every = np.concatenate(faces)
    side = np.sign(mirror - np.arange(len(mirror)))  # +1 for left vertices: created before their mirror
    left = every[(side[every] > 0).any(axis=1)]
    assert not (side[left] < 0).any()
    both = np.concatenate([left, mirror[left][:, [0, 3, 2, 1]]]).astype(np.int32)
    return Layout(len(mirror), both, mirror, grid, crown, rings, patches)
