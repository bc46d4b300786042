# SPDX-License-Identifier: GPL-3.0-or-later
"""Three cells become one, with quads only: where the grid of the skin gets by with every third row or column.

    a0 --------- b0
    |          / |
    a1 ---- c1   |
    |       |    |
    a2 ---- c2   |
    |          \\ |
    a3 --------- b1

Thinnings side by side are staggered, so that each ``b`` belongs to one of them per column and has five neighbours.
"""

from dataclasses import dataclass

#: (u, v)
Place = tuple[int, int]


@dataclass(frozen=True)
class RowThinning:
    """Beyond column ``u`` + 1 the rows v + 1 and v + 2 are left out, as far as the back midline."""

    u: int
    v: int

    @property
    def inner(self) -> list[Place]:
        """c1, c2: they stand in the first column of the thinned part."""
        return [(self.u + 1, self.v + 1), (self.u + 1, self.v + 2)]

    def removed(self, half: int, rows: int) -> list[Place]:
        """Places without a vertex."""
        return [(u, v) for v in (self.v + 1, self.v + 2) for u in range(self.u + 2, half + 1)]

    def dead(self, half: int, rows: int) -> list[Place]:
        """Cells, by their upper corner nearer the front, that are no faces of the plain grid."""
        return [(u, v) for v in range(self.v, self.v + 3) for u in range(self.u, half)]

    def faces(self, half: int, rows: int) -> list[list[Place]]:
        """The quads instead."""
        u, v = self.u, self.v
        a, b, (c1, c2) = [(u, v + k) for k in range(4)], [(u + 1, v), (u + 1, v + 3)], self.inner
        joint = [[a[0], a[1], c1, b[0]], [a[1], a[2], c2, c1], [a[2], a[3], b[1], c2], [c1, c2, b[1], b[0]]]
        return joint + [[(k, v), (k, v + 3), (k + 1, v + 3), (k + 1, v)] for k in range(u + 1, half)]


@dataclass(frozen=True)
class ColumnThinning:
    """Beyond row ``v`` + ``way`` (1 downward, -1 upward) the columns u + 1 and u + 2 are left out to the end."""

    u: int
    v: int
    way: int

    @property
    def inner(self) -> list[Place]:
        """c1, c2: they stand in the first row of the thinned part."""
        return [(self.u + 1, self.v + self.way), (self.u + 2, self.v + self.way)]

    def _beyond(self, rows: int) -> range:
        return range(self.v + self.way, rows if self.way > 0 else -1, self.way)

    def removed(self, half: int, rows: int) -> list[Place]:
        """Places without a vertex."""
        return [(u, v) for u in (self.u + 1, self.u + 2) for v in self._beyond(rows)[1:]]

    def dead(self, half: int, rows: int) -> list[Place]:
        """Cells, by their upper corner nearer the front, that are no faces of the plain grid."""
        beyond = range(self.v, rows - 1) if self.way > 0 else range(0, self.v)
        return [(u, v) for u in range(self.u, self.u + 3) for v in beyond]

    def faces(self, half: int, rows: int) -> list[list[Place]]:
        """The quads instead."""
        u, v, w = self.u, self.v, self.v + self.way
        a, b, (c1, c2) = [(u + k, v) for k in range(4)], [(u, w), (u + 3, w)], self.inner
        quads = [[a[0], b[0], c1, a[1]], [a[1], c1, c2, a[2]], [a[2], c2, b[1], a[3]], [c1, b[0], b[1], c2]]
        far = self._beyond(rows)
        quads += [[(u, k), (u, k + self.way), (u + 3, k + self.way), (u + 3, k)] for k in far[:-1]]
        return quads if self.way > 0 else [q[::-1] for q in quads]


#: Behind the jaw (rows 15 to 27) and at the back of the head.
ROW_THINNINGS = (
    *(RowThinning(12, 15), RowThinning(11, 18), RowThinning(12, 21), RowThinning(11, 24)),
    *(RowThinning(20, 6), RowThinning(19, 9), RowThinning(20, 12)),
)

#: Up to the crown, and down the neck from below the crease of the throat on: 48 columns become 32.
COLUMN_THINNINGS = (
    *(ColumnThinning(u, 1, -1) for u in (1, 5, 9, 13)),
    *(ColumnThinning(u, 29, 1) for u in (1, 5, 9, 13)),
)
