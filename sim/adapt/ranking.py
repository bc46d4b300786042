# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles compete for points: the near one that faces the same way wins."""

import numpy as np


def least(row, cost):
    """The rows (r,) that occur in ``row`` (k,), ascending, and where the first of the least ``cost`` (k,) of each is.

    ``row`` must be in ascending order.
    """
    if len(row) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    start = np.flatnonzero(np.concatenate([[True], row[1:] != row[:-1]]))
    lowest = np.minimum.reduceat(cost, start)
    is_least = np.flatnonzero(cost == np.repeat(lowest, np.diff(np.append(start, len(row)))))
    first = is_least[np.concatenate([[True], row[is_least][1:] != row[is_least][:-1]])]
    return row[first], first


class Ranking:
    """The best place on a surface found so far for each of ``points`` (k, 3) mm with unit ``normals`` (k, 3).

    Only places within ``reach`` mm whose normal agrees by at least ``agreement`` (cosine) count; they compete by
    distance x (1 + bend (1 - cosine)).

    cost (k,) : infinite where there is none yet; triangle (k,) int, -1; weights (k, 3) barycentric; distance (k,) mm
    """

    def __init__(self, surface, points, normals, reach: float, agreement: float, bend: float):
        self._surface, self._points, self._normals = surface, points, normals
        self._reach, self._agreement, self._bend = reach, agreement, bend
        k = len(points)
        self.cost, self.distance = np.full(k, np.inf), np.full(k, np.inf)
        self.triangle, self.weights = np.full(k, -1), np.zeros((k, 3))

    def improve(self, row, owner, bound) -> None:
        """Let the pairs of a point ``row`` (p,), ascending, and a triangle ``owner`` (p,) compete, which are no nearer
        than ``bound`` (p,) mm."""
        # What costs no less than the best so far even if it faced the same way needs no look.
        some = np.flatnonzero(bound < self.cost[row])
        row, owner = row[some], owner[some]
        weights, distance = self._surface.solid.closest(self._points, row, owner)
        some = np.flatnonzero((distance < self.cost[row]) & (distance <= self._reach))
        row, owner, weights, distance = row[some], owner[some], weights[some], distance[some]
        normal = self._surface.smooth_normals(owner, weights)
        cosine = np.einsum("ij,ij->i", normal, self._normals[row])
        cosine /= np.maximum(np.sqrt(np.einsum("ij,ij->i", normal, normal)), 1e-12)
        cost = np.where(cosine >= self._agreement, distance * (1 + self._bend * (1 - cosine)), np.inf)
        at, pick = least(row, cost)
        better = cost[pick] < self.cost[at]
        at, pick = at[better], pick[better]
        self.cost[at], self.distance[at] = cost[pick], distance[pick]
        self.triangle[at], self.weights[at] = owner[pick], weights[pick]

    def contacts(self):
        """What was found, as the `Contacts` of the surface."""
        at = np.flatnonzero(self.triangle >= 0)
        return self._surface.contacts(len(self.cost), at, self.distance[at], self.triangle[at], self.weights[at])
