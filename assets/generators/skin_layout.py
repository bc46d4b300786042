# SPDX-License-Identifier: GPL-3.0-or-later
"""Connectivity of the reference skin: a cylinder of quads with holes refilled by concentric rings.

Columns ``u`` run around the head from the front midline (u = 0) to the back midline (u = `HALF`), positive on the
subject's left; rows ``v`` run from the crown down to the neck. A square patch closes the crown. Rectangular blocks of
cells are taken out for mouth, eyes, nostrils and ears; every hole is refilled by rings with as many vertices as the
block has on its perimeter, so all faces are quads, loops are concentric and poles sit on block corners only.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

#: Columns from the front to the back midline.
HALF = 24

#: Rows of vertices; row 0 borders the crown patch, the last is the open edge of the neck.
ROWS = 31

#: Cells along one side of the crown patch.
CROWN = HALF // 2


@dataclass(frozen=True)
class Block:
    """Cells removed between columns u0..u1 and rows v0..v1, the rings that refill them, and the final patch.

    ``patch`` = (first ring vertex, cells down, cells across) of the grid that closes the last ring.
    """

    u0: int
    u1: int
    v0: int
    v1: int
    rings: int
    patch: tuple[int, int, int]

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
    "mouth": Block(-5, 5, 16, 22, 10, (2, 2, 14)),
    "eye": Block(3, 11, 5, 9, 8, (1, 2, 10)),
    "nostril": Block(1, 3, 13, 15, 3, (0, 2, 2)),
    "ear": Block(15, 19, 7, 15, 8, (-1, 10, 2)),
}


@dataclass(frozen=True, eq=False)
class Layout:
    """The finished connectivity.

    Attributes
    ----------
    count : number of vertices
    faces : (m, 4) int32, counter-clockwise seen from outside; the second half mirrors the first
    mirror : (count,) int32, the vertex on the other side
    grid : (ROWS, 2 * HALF) int32, vertex at column u modulo 2 * HALF; -1 where a block was removed
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


def _cells(table: np.ndarray) -> np.ndarray:
    """(m, 4) quads of a vertex table [row downward, column rightward], counter-clockwise."""
    a, b, c, d = table[:-1, :-1], table[1:, :-1], table[1:, 1:], table[:-1, 1:]
    return np.stack([a, b, c, d], axis=-1).reshape(-1, 4)


def _perimeter_of(down: int, across: int) -> list[tuple[int, int]]:
    block = Block(0, across, 0, down, 0, (0, 0, 0))
    return [(v, u) for u, v in block.perimeter]


@cache
def skin_layout() -> Layout:
    """The connectivity of the reference skin; every call gives the same."""
    removed = np.zeros((ROWS, 2 * HALF), dtype=bool)
    holes = {}
    for name, block in BLOCKS.items():
        for sign in (1,) if name == "mouth" else (1, -1):
            for u in range(block.u0 + 1, block.u1):
                removed[block.v0 + 1 : block.v1, (sign * u) % (2 * HALF)] = True
    mirror: list[int] = []
    column = np.arange(2 * HALF)
    grid = np.full((ROWS, 2 * HALF), -1, dtype=np.int32)
    for v in range(ROWS):  # left vertex first, its mirror right after it
        for u in range(HALF + 1):
            if removed[v, u]:
                continue
            grid[v, u] = len(mirror)
            if u in (0, HALF):
                mirror.append(len(mirror))
            else:
                grid[v, -u] = len(mirror) + 1
                mirror += [len(mirror) + 1, len(mirror)]

    def pair() -> tuple[int, int]:
        first = len(mirror)
        mirror.extend([first + 1, first])
        return first, first + 1

    def single() -> int:
        mirror.append(len(mirror))
        return len(mirror) - 1

    def table(rows: int, columns: int, border: dict) -> np.ndarray:
        """A vertex table symmetric about its middle column, with given border vertices."""
        out = np.full((rows, columns), -1, dtype=np.int32)
        for (row, col), vertex in border.items():
            out[row, col] = vertex
        for row in range(rows):
            for col in range((columns + 1) // 2):
                if out[row, col] < 0:
                    if col == columns - 1 - col:
                        out[row, col] = single()
                    else:
                        out[row, columns - 1 - col], out[row, col] = pair()
        return out

    faces = []
    wrapped = np.concatenate([grid, grid[:, :1]], axis=1)
    cells = _cells(wrapped).reshape(ROWS - 1, 2 * HALF, 4)
    inside = np.zeros((ROWS - 1, 2 * HALF), dtype=bool)
    for name, block in BLOCKS.items():
        for u in range(block.u0, block.u1):
            inside[block.v0 : block.v1, u % (2 * HALF)] = True
            if name != "mouth":
                inside[block.v0 : block.v1, (-u - 1) % (2 * HALF)] = True
    assert (cells[~inside] >= 0).all()
    faces.append(cells[~inside])

    border = {}
    for u in column:  # crown table [back-ward, right to left]
        signed = u if u <= HALF else u - 2 * HALF
        half, size = CROWN // 2, CROWN
        if abs(signed) <= half:
            spot = (0, signed + half)
        elif abs(signed) <= half + size:
            spot = (abs(signed) - half, size if signed > 0 else 0)
        else:
            away = HALF - abs(signed)
            spot = (size, half + away * (1 if signed > 0 else -1))
        border[spot] = int(grid[0, u])
    crown = table(CROWN + 1, CROWN + 1, border)
    faces.append(_cells(crown)[:, ::-1])

    rings, patches = {}, {}
    for name, block in BLOCKS.items():
        around = block.perimeter
        size = len(around)
        if name == "mouth":
            height, width = block.v1 - block.v0, block.u1 - block.u0
            other = [(2 * height + width - i) % size for i in range(size)]
            levels = np.empty((block.rings + 1, size), dtype=np.int32)
            levels[0] = [grid[v, u % (2 * HALF)] for u, v in around]
            for ring in range(1, block.rings + 1):
                levels[ring] = -1
                for i in range(size):
                    if around[i][0] == 0:
                        levels[ring, i] = single()
                    elif around[i][0] > 0:
                        levels[ring, i], levels[ring, other[i]] = pair()
            start, down, across = block.patch
            spots = _perimeter_of(down, across)
            patch = table(down + 1, across + 1, {s: levels[-1, (start + i) % size] for i, s in enumerate(spots)})
            holes["mouth"] = (levels, patch, 1)
        else:
            both = np.empty((2, block.rings + 1, size), dtype=np.int32)
            both[0, 0] = [grid[v, u] for u, v in around]
            both[1, 0] = [grid[v, -u] for u, v in around]
            for ring in range(1, block.rings + 1):
                for i in range(size):
                    both[0, ring, i], both[1, ring, i] = pair()
            start, down, across = block.patch
            fill = np.full((2, down + 1, across + 1), -1, dtype=np.int32)
            for i, spot in enumerate(_perimeter_of(down, across)):
                fill[(slice(None), *spot)] = both[:, -1, (start + i) % size]
            for row, col in np.argwhere(fill[0] < 0):
                fill[:, row, col] = pair()
            holes[name + "_l"] = (both[0], fill[0], 1)
            holes[name + "_r"] = (both[1], fill[1], -1)
    for name, (levels, patch, sign) in holes.items():
        rings[name], patches[name] = levels, patch
        closed = np.concatenate([levels, levels[:, :1]], axis=1)
        quads = np.stack([closed[:-1, :-1], closed[:-1, 1:], closed[1:, 1:], closed[1:, :-1]], axis=-1).reshape(-1, 4)
        quads = np.concatenate([quads, _cells(patch)])
        faces.append(quads if sign > 0 else quads[:, ::-1])

    mirror_of = np.array(mirror, dtype=np.int32)
    every = np.concatenate(faces)
    side = np.sign(mirror_of - np.arange(len(mirror_of)))  # +1 for left vertices: created before their mirror
    left = every[(side[every] > 0).any(axis=1)]
    assert not (side[left] < 0).any() and 2 * len(left) == len(every)
    right = mirror_of[left][:, [0, 3, 2, 1]]
    return Layout(
        len(mirror_of), np.concatenate([left, right]).astype(np.int32), mirror_of, grid, crown, rings, patches
    )
