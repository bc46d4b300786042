# SPDX-License-Identifier: GPL-3.0-or-later
"""The best places on a surface for points that are asked for again and again and move little in between.

As in molecular dynamics (Verlet 1967): the triangles near a point are looked up once and kept until the point has moved
by a good part of the distance that was looked at.
"""

import numpy as np

from .closest import Contacts, Surface
from .ranking import Ranking

FEW, MANY = 8, 32  # nearest samples that are looked up for a point, and where those do not show a place beyond doubt
SLACK = 0.2  # share of the distance looked at by which a point may move before it is looked at anew
FARTHEST = 1.0  # mm that it may move in any case


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
        cover = self.target.cover
        moved = np.linalg.norm(points - self._at[rows], axis=1)
        stale = np.flatnonzero(~(moved <= np.minimum(SLACK * self._seen[rows], FARTHEST)))
        self._look(rows[stale], points[stale], FEW, reach)
        moved[stale] = 0
        ranking = Ranking(self.target, points, normals, reach, agreement, bend)
        self._compete(ranking, rows, np.arange(len(rows)), moved)
        doubt = stale[self._seen[rows[stale]] - cover.usual < ranking.cost[stale]]
        doubt = doubt[np.isfinite(self._seen[rows[doubt]])]
        if len(doubt):
            self._look(rows[doubt], points[doubt], MANY, reach)
            self._compete(ranking, rows, doubt, moved)
        return ranking.contacts()

    def _look(self, rows, points, count, reach):
        """Look up the triangles near points."""
        cover = self.target.cover
        far, sample = cover.nearest(points, count, reach)
        self._at[rows], self._seen[rows] = points, far[:, -1]
        self._near[rows, : far.shape[1]], self._far[rows, : far.shape[1]] = np.append(cover.owner, -1)[sample], far
        self._far[rows, far.shape[1] :] = np.inf

    def _compete(self, ranking, rows, some, moved):
        """Let the triangles near the points ``some`` of ``rows`` compete, the one that was best before all others."""
        near, bound = self._near[rows[some]], self._far[rows[some]] - moved[some, None]
        best = self._best[rows[some]]
        first = np.where(best >= 0, best, near[:, 0])
        at = np.flatnonzero(first >= 0)
        ranking.improve(some[at], first[at], np.zeros(len(at)))
        # What is infinitely far is none; of several samples of a triangle each may compete.
        row, column = np.nonzero(bound < (ranking.cost[some] + self.target.cover.most)[:, None])
        owner = near[row, column]
        keep = np.flatnonzero(owner != first[row])
        row, column, owner = row[keep], column[keep], owner[keep]
        ranking.improve(some[row], owner, bound[row, column] - self.target.cover.radius[owner])
        self._best[rows[some]] = ranking.triangle[some]
