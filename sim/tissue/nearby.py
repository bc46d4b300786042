# SPDX-License-Identifier: GPL-3.0-or-later
"""Which points need a look: those that may have come near what they could touch since they were last looked at.

A point that lay so many mm away stays clear until it has moved about as far. What it could touch has corners, whose planes
change faster than the point moves, so a share of the way has to do.
"""

import numpy as np

#: Share of its distance that a point may move unseen.
SHARE = 0.7


class Nearby:
    """Remembers, surface by surface, where points were when they were looked at, and how far they may move from there."""

    def __init__(self):
        self._known = {}

    def due(self, surface, points) -> np.ndarray:
        """Rows (c,) of ``points`` (k, 3) mm, in the frame of ``surface`` (anything that is its own), to look at now."""
        if surface not in self._known:
            self._known[surface] = points.copy(), np.full(len(points), -1.0)
        then, room = self._known[surface]
        away = points - then
        return np.flatnonzero(np.einsum("ij,ij->i", away, away) > np.abs(room) * room)

    def seen(self, surface, rows, points, distance):
        """That ``rows`` (c,) of ``points`` (k, 3) are the mm ``distance`` (c,) away from where they would matter."""
        then, room = self._known[surface]
        then[rows] = points[rows]
        room[rows] = SHARE * distance
