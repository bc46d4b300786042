# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays against a head, for measuring it: where does the skin lie at given two coordinates?"""

import numpy as np

from ...sim.adapt.closest import Surface

#: Control kind (see `skin_controls`) -> ray start (nan: a given coordinate, in order) and direction.
_KINDS = {
    "F": ((np.nan, -400.0, np.nan), (0, 1, 0)),
    "B": ((np.nan, 400.0, np.nan), (0, -1, 0)),
    "S": ((400.0, np.nan, np.nan), (-1, 0, 0)),
    "D": ((np.nan, np.nan, -130.0), (0, 0, 1)),
    "T": ((np.nan, np.nan, 400.0), (0, 0, -1)),
}


class MeasuredHead:
    """A head mesh (mm, frame of the reference head) that answers rays and closest points.

    vertices : (n, 3); triangles : (m, 3)
    """

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray):
        self.surface = Surface(vertices, triangles)
        corner = [self.surface.vertices[self.surface.triangles[:, k]] for k in range(3)]
        self._a, self._e1, self._e2 = corner[0], corner[1] - corner[0], corner[2] - corner[0]

    def mirrored(self) -> "MeasuredHead":
        """The same head with its sides exchanged."""
        return MeasuredHead(self.surface.vertices * [-1, 1, 1], self.surface.triangles[:, ::-1])

    def cast(self, starts, direction) -> np.ndarray:
        """(k, 3) first hits of rays from ``starts`` (k, 3); nan where nothing is hit (Möller and Trumbore 1997)."""
        starts = np.atleast_2d(starts).astype(float)
        directions = np.broadcast_to(np.asarray(direction, float), starts.shape)
        out = np.full(starts.shape, np.nan)
        for first in range(0, len(starts), 64):
            o, d = starts[first : first + 64, None], directions[first : first + 64, None]
            h = np.cross(d, self._e2[None])
            det = (h * self._e1).sum(-1)
            inverse = 1 / np.where(np.abs(det) > 1e-12, det, np.inf)
            off = o - self._a
            u = (off * h).sum(-1) * inverse
            q = np.cross(off, self._e1[None])
            v, t = (d * q).sum(-1) * inverse, (self._e2 * q).sum(-1) * inverse
            hit = (np.abs(det) > 1e-12) & (u >= -1e-7) & (v >= -1e-7) & (u + v <= 1 + 1e-7) & (t > 0)
            nearest = np.where(hit, t, np.inf).min(axis=1)
            found = np.isfinite(nearest)
            out[first : first + 64][found] = (o[:, 0] + d[:, 0] * np.where(found, nearest, 0)[:, None])[found]
        return out

    def front(self, xz) -> np.ndarray:
        """(k, 3) points seen from the front at (x, z)."""
        xz = np.asarray(xz, float)
        return self.cast(np.stack([xz[:, 0], np.full(len(xz), -400.0), xz[:, 1]], axis=1), (0, 1, 0))

    def left(self, yz) -> np.ndarray:
        """(k, 3) points seen from the subject's left at (y, z)."""
        yz = np.asarray(yz, float)
        return self.cast(np.stack([np.full(len(yz), 400.0), yz[:, 0], yz[:, 1]], axis=1), (-1, 0, 0))

    def closest(self, points) -> np.ndarray:
        """(k, 3) nearest points of the surface."""
        return self.surface.closest(points).points

    def controls(self, controls) -> np.ndarray:
        """(k, 3) points of control entries (see `skin_controls`)."""
        out = np.empty((len(controls), 3))
        for row, (kind, *given) in enumerate(controls):
            if kind == "N":
                out[row] = self.closest(np.array([given], float))[0]
                continue
            start, direction = _KINDS[kind]
            start = np.array(start)
            start[np.isnan(start)] = given
            out[row] = self.cast(start[None], direction)[0]
        if np.isnan(out).any():
            missed = [controls[i] for i in np.flatnonzero(np.isnan(out).any(axis=1))]
            raise ValueError(f"control rays that miss the head: {missed}")
        return out
