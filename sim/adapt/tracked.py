# SPDX-License-Identifier: GPL-3.0-or-later
"""The best places on a surface for points that are asked for again and again and move little in between.

As in molecular dynamics (Verlet 1967): the triangles near a point are looked up once and kept until the point has moved
by a good part of the distance that was looked at. A point that lies on the triangle that was best before needs not even
those.
"""

import numpy as np

from .closest import Contacts, Surface
from .ranking import Ranking

FEW, MANY = 5, 32  # nearest samples that are looked up for a point, and where those do not show a place beyond doubt
SLACK = 0.2  # share of the distance looked at by which a point may move before it is looked at anew
FARTHEST = 1.0  # mm that it may move in any case
SURE = 0.1  # mm: a perpendicular no longer than this shows the place. Farther off points would stick to old triangles
BLIND = 0.5  # share of how far triangles usually reach from their samples by which one not looked up may lie nearer


class Tracked:
    """Places on ``target`` for ``count`` points, each known by its number."""

    def __init__(self, target: Surface, count: int):
        self.target = target
        self._at = np.full((count, 3), np.inf)
        self._seen = np.zeros(count)
        self._best = np.full(count, -1)
        self._near = np.full((count, MANY), -1)
        self._far = np.full((count, MANY), np.inf)

    def ranked(self, rows, points, normals, reach: float, agreement: float, bend: float = 1.0) -> Contacts:
        """As `Surface.ranked`, for the points with the numbers ``rows`` (k,), which are now at ``points`` (k, 3) mm.

        A triangle much larger than others may be overlooked. ``reach`` must not grow from one time to the next.
        """
        ranking = Ranking(self.target, points, normals, reach, agreement, bend)
        best = self._best[rows]
        known = np.flatnonzero(best >= 0)
        ranking.improve(known, best[known], np.zeros(len(known)))
        left = np.flatnonzero(~settled(ranking))
        moved = np.linalg.norm(points[left] - self._at[rows[left]], axis=1)
        stale = ~(moved <= np.minimum(SLACK * self._seen[rows[left]], FARTHEST))
        anew = left[stale]
        self._look(rows[anew], points[anew], FEW, reach)
        moved[stale] = 0
        self._compete(ranking, rows, left, moved)
        usual = BLIND * self.target.cover.usual
        doubt = anew[~settled(ranking)[anew] & (self._seen[rows[anew]] - usual < ranking.cost[anew])]
        doubt = doubt[np.isfinite(self._seen[rows[doubt]])]
        if len(doubt):
            self._look(rows[doubt], points[doubt], MANY, reach)
            self._compete(ranking, rows, doubt, np.zeros(len(doubt)))
        self._best[rows] = ranking.triangle
        return ranking.contacts()

    def _look(self, rows, points, count, reach):
        """Look up the triangles near points."""
        cover = self.target.cover
        far, sample = cover.nearest(points, count, reach)
        self._at[rows], self._seen[rows] = points, far[:, -1]
        self._near[rows, : far.shape[1]], self._far[rows, : far.shape[1]] = np.append(cover.owner, -1)[sample], far
        self._far[rows, far.shape[1] :] = np.inf

    def _compete(self, ranking, rows, some, moved):
        """Let the triangles near the points ``some`` of ``rows`` compete, that of the nearest sample before all others."""
        near, bound = self._near[rows[some]], self._far[rows[some]] - moved[:, None]
        at = np.flatnonzero(near[:, 0] >= 0)
        ranking.improve(some[at], near[at, 0], np.maximum(bound[at, 0] - self.target.cover.radius[near[at, 0]], 0))
        # What is infinitely far is none; of several samples of a triangle each may compete.
        bound[settled(ranking)[some]] = np.inf
        row, column = np.nonzero(bound < (ranking.cost[some] + self.target.cover.most)[:, None])
        owner = near[row, column]
        keep = np.flatnonzero(owner != near[row, 0])
        row, column, owner = row[keep], column[keep], owner[keep]
        ranking.improve(some[row], owner, bound[row, column] - self.target.cover.radius[owner])


def settled(ranking: Ranking) -> np.ndarray:
    """(k,) bool: the place found so far is the foot of the perpendicular on its triangle, and near."""
    return (ranking.cost < SURE) & (ranking.weights > 0).all(axis=1)
