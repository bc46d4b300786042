# SPDX-License-Identifier: GPL-3.0-or-later
"""Which boxes of one set overlap which of another: a binary tree of boxes over each, walked together level by level."""

import numpy as np

#: Pairs of nodes looked at in one go.
BLOCK = 2_000_000


class BoxTree:
    """Axis-aligned boxes under a complete binary tree in Morton order.

    low, high (n, 3) mm : corners of the boxes, n > 0
    """

    def __init__(self, low, high):
        low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        self.count = len(low)
        self.depth = max(int(np.ceil(np.log2(max(self.count, 1)))), 0)
        self.order = np.argsort(morton((low + high) / 2), kind="stable")
        size = 1 << self.depth
        # Level d holds 2**d boxes; what the last level has too many is empty (low > high) and overlaps nothing.
        bottom_low, bottom_high = np.full((size, 3), np.inf), np.full((size, 3), -np.inf)
        bottom_low[: self.count], bottom_high[: self.count] = low[self.order], high[self.order]
        self.low, self.high = [bottom_low], [bottom_high]
        for _ in range(self.depth):
            self.low.insert(0, np.minimum(self.low[0][::2], self.low[0][1::2]))
            self.high.insert(0, np.maximum(self.high[0][::2], self.high[0][1::2]))

    @classmethod
    def of(cls, vertices, triangles, margin: float = 0.0) -> "BoxTree":
        """The boxes round triangles (m, 3) over vertices (n, 3) mm, each ``margin`` mm larger."""
        corners = np.asarray(vertices, dtype=float)[triangles]
        return cls(corners.min(axis=1) - margin, corners.max(axis=1) + margin)

    def overlaps(self, other: "BoxTree") -> tuple[np.ndarray, np.ndarray]:
        """(k,), (k,) indices of a box of this tree and one of ``other`` that overlap; with itself, each pair once."""
        same = other is self
        found = []
        stack = [(0, 0, np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64))]
        while stack:
            a, b, i, j = stack.pop()
            meet = (self.low[a][i] <= other.high[b][j]).all(axis=1) & (other.low[b][j] <= self.high[a][i]).all(axis=1)
            i, j = i[meet], j[meet]
            if len(i) == 0:
                continue
            if a == self.depth and b == other.depth:
                keep = i < j if same else slice(None)
                found.append((self.order[i[keep]], other.order[j[keep]]))
                continue
            down_a, down_b = a < self.depth, b < other.depth
            i, j = (
                (2 * i + np.array([[0], [1]]) if down_a else i[None]),
                (2 * j + np.array([[0], [1]]) if down_b else j[None]),
            )
            i, j = (x.ravel() for x in np.broadcast_arrays(i[:, None], j[None]))
            if same:
                keep = i <= j
                i, j = i[keep], j[keep]
            for start in range(0, len(i), BLOCK):
                part = slice(start, start + BLOCK)
                stack.append((a + down_a, b + down_b, i[part], j[part]))
        if not found:
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        first, second = (np.concatenate(x) for x in zip(*found, strict=True))
        return (np.minimum(first, second), np.maximum(first, second)) if same else (first, second)


def morton(points):
    """(n,) int64 for points (n, 3): the bits of x, y and z in turn, 1024 steps along the longest side."""
    span = max(float(np.ptp(points, axis=0).max()), 1e-12)
    cell = ((points - points.min(axis=0)) / span * 1023).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= (cell[:, axis] >> bit & 1) << (3 * bit + axis)
    return code
