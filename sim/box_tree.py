# SPDX-License-Identifier: GPL-3.0-or-later
"""Which boxes of one set overlap which of another, and which lie near points: binary trees walked level by level."""

import numpy as np

#: Pairs of nodes looked at in one go, and points.
BLOCK, POINTS = 2_000_000, 4000
#: Levels of a tree that are passed over: near the root every box is near every point.
ROOTS = 3


class BoxTree:
    """Axis-aligned boxes under a complete binary tree in Morton order.

    low, high (n, 3) mm : corners of the boxes, n > 0
    """

    def __init__(self, low, high):
        low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        self.count = len(low)
        self.depth = max(int(np.ceil(np.log2(max(self.count, 1)))), 0)
        low, high = (np.ascontiguousarray(corner.T) for corner in (low, high))
        # With its index each key is another, and sorting keys is faster than sorting indices by them.
        self.order = np.sort(morton((low + high) / 2) << 32 | np.arange(self.count)) & 0xFFFFFFFF
        # Level d holds 2**d boxes; what the last level has too many is empty (low > high) and overlaps nothing.
        bottom = np.full((6, 1 << self.depth), -np.inf)
        bottom[:3] = np.inf
        bottom[:3, : self.count], bottom[3:, : self.count] = low.take(self.order, axis=1), high.take(self.order, axis=1)
        #: Per level the corners as planes (6, k): low x, y, z and high x, y, z.
        self.levels = [bottom]
        for _ in range(self.depth):
            one, other = self.levels[0][:, ::2], self.levels[0][:, 1::2]
            self.levels.insert(0, np.concatenate([np.minimum(one[:3], other[:3]), np.maximum(one[3:], other[3:])]))

    @classmethod
    def of(cls, vertices, triangles, margin: float = 0.0) -> "BoxTree":
        """The boxes round triangles (m, 3) over vertices (n, 3) mm, each ``margin`` mm larger."""
        planes, triangles = np.ascontiguousarray(np.asarray(vertices, dtype=float).T), np.asarray(triangles)
        a, b, c = (planes.take(triangles[:, k], axis=1) for k in range(3))
        low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        return cls(low.T - margin, high.T + margin)

    def near(self, points, reach):
        """Pairs of a point and a box no farther than ``reach`` (k,) mm from it: (p,) ascending and (p,).

        points : (k, 3) mm
        """
        square = np.asarray(reach, dtype=float) ** 2

        def meets(planes, row, corner):
            at = planes.take(row, axis=1)
            gap = np.maximum(np.maximum(corner[:3] - at, at - corner[3:]), 0)
            return gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2] <= square[row]

        return self._walked(np.ascontiguousarray(np.asarray(points, dtype=float).T), meets)

    def along(self, origins, directions, reach):
        """Pairs of a line ``origin + t direction``, -reach <= t <= reach, and a box that it meets: (p,) ascending, (p,).

        origins, directions : (k, 3) mm, unit; reach : mm. Boxes that it only just misses may be among them.
        """
        ways = np.where(np.abs(directions) < 1e-12, 1e-12, directions)

        def meets(planes, row, corner):
            at, slow = planes[:3].take(row, axis=1), planes[3:].take(row, axis=1)
            one, other = (corner[:3] - at) * slow, (corner[3:] - at) * slow
            into, out = np.minimum(one, other).max(axis=0), np.maximum(one, other).min(axis=0)
            there = corner[0] <= corner[3]  # not one of those that only fill the last level
            return there & (into <= out + 1e-9) & (into <= reach) & (out >= -reach)

        return self._walked(np.concatenate([np.asarray(origins, dtype=float).T, 1 / ways.T]), meets)

    def _walked(self, planes, meets):
        """Pairs (p,), (p,) of columns of ``planes`` (d, k) and boxes for which ``meets(planes, columns, corners)``."""
        found = [(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))]
        for start in range(0, planes.shape[1], POINTS):
            stop = min(start + POINTS, planes.shape[1])
            level = min(ROOTS, self.depth)
            row = np.repeat(np.arange(start, stop), 1 << level)
            node = np.tile(np.arange(1 << level), stop - start)
            while True:
                keep = np.flatnonzero(meets(planes, row, self.levels[level].take(node, axis=1)))
                row, node = row[keep], node[keep]
                if level == self.depth:
                    break
                level += 1
                row, node = np.repeat(row, 2), np.repeat(2 * node, 2)
                node[1::2] += 1
            found.append((row, self.order[node]))
        first, second = (np.concatenate(x) for x in zip(*found, strict=True))
        return first, second

    def overlaps(self, other: "BoxTree") -> tuple[np.ndarray, np.ndarray]:
        """(k,), (k,) indices of a box of this tree and one of ``other`` that overlap; with itself, each pair once."""
        same = other is self
        found = []
        stack = [(0, 0, np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64))]
        while stack:
            a, b, i, j = stack.pop()
            one, another = self.levels[a].take(i, axis=1), other.levels[b].take(j, axis=1)
            meet = ((one[:3] <= another[3:]) & (another[:3] <= one[3:])).all(axis=0)
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


def morton(planes):
    """(n,) int64 for points as ``planes`` (3, n): the bits of x, y and z in turn, 1024 steps along the longest side."""
    low, high = planes.min(axis=1), planes.max(axis=1)
    span = max(float((high - low).max()), 1e-12)
    cell = ((planes - low[:, None]) / span * 1023).astype(np.int64)
    # Ten bits spread out, two places between each, by halves.
    for shift, mask in ((16, 0x30000FF), (8, 0x300F00F), (4, 0x30C30C3), (2, 0x9249249)):
        cell |= cell << shift
        cell &= mask
    return cell[0] | cell[1] << 1 | cell[2] << 2
