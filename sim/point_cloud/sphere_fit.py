# SPDX-License-Identifier: GPL-3.0-or-later
"""The surface that points with normals lie on, as spheres fitted about each place.

After Guennebaud and Gross 2007, "Algebraic point set surfaces", section 4.2: the sphere whose gradient is nearest to the
normals. A plane there would lay what is round, as a lip, too far out.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from .neighbourhoods import batches

#: Points about a place that make its sphere. More of them smooth a lip away, fewer keep the noise.
AROUND = 10


@dataclass(frozen=True, eq=False)
class Spheres:
    """The spheres of ``points`` (n, 3) with unit ``normals`` (n, 3), which are ``apart`` (n,) from each other and have
    ``values`` (n, k)."""

    points: np.ndarray
    normals: np.ndarray
    apart: np.ndarray
    values: np.ndarray

    def __post_init__(self):
        object.__setattr__(self, "tree", cKDTree(self.points))

    def about(self, places: np.ndarray) -> np.ndarray:
        """(m,) how far ``places`` (m, 3) lie outside of the plane through the nearest point."""
        near = self.tree.query(places, workers=-1)[1]
        return np.einsum("ij,ij->i", places - self.points[near], self.normals[near])

    def outside(self, places: np.ndarray) -> np.ndarray:
        """(m,) how far ``places`` (m, 3), no more than `neighbourhoods.BATCH`, lie outside of the surface."""
        return self._fitted(places)[0]

    def onto(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """``places`` (m, 3) moved onto the surface along its slope; (m,) how many spacings they were from the nearest point;
        and the values (m, k) about them."""
        moved, away, values = (
            np.empty_like(places),
            np.empty(len(places)),
            np.empty((len(places), self.values.shape[1])),
        )
        for rows in batches(len(places)):
            off, slope, (distance, weight, near) = self._fitted(places[rows])
            moved[rows] = places[rows] - off[:, None] * slope
            away[rows] = distance[:, 0] / np.einsum("mk,mk->m", weight, self.apart[near])
            values[rows] = np.einsum("mk,mkv->mv", weight, self.values[near])
        return moved, away, values

    def _weights(self, places):
        """Distances (m, k), weights and indices of the points about ``places``.

        Those weigh more that lie in the open, so that where points are close on one side and far apart on the other both
        count; and none that face away from the nearest, as on the other side of an ear.
        """
        distance, near = self.tree.query(places, k=AROUND, workers=-1)
        alike = np.einsum("mki,mi->mk", self.normals[near], self.normals[near[:, 0]])
        weight = (1 - (distance / distance[:, -1:]) ** 2) ** 4 * np.maximum(alike, 0) ** 2 * self.apart[near] ** 2
        weight[:, 0] += np.finfo(float).tiny
        return distance, weight / weight.sum(axis=1, keepdims=True), near

    def _fitted(self, places):
        """Distances (m,) of ``places`` (m, 3) from their spheres, unit slopes (m, 3) there, and `_weights`."""
        distance, weight, near = self._weights(places)
        at, facing = self.points[near] - places[:, None], self.normals[near]
        p, n = np.einsum("mk,mki->mi", weight, at), np.einsum("mk,mki->mi", weight, facing)
        pn, pp = np.einsum("mk,mki,mki->m", weight, at, facing), np.einsum("mk,mki,mki->m", weight, at, at)
        spread = pp - np.einsum("mi,mi->m", p, p)
        bend = (pn - np.einsum("mi,mi->m", p, n)) / np.where(spread > 0, 2 * spread, np.inf)
        slope = n - 2 * bend[:, None] * p
        level = -np.einsum("mi,mi->m", slope, p) - bend * pp
        # The field is level + slope·x + bend x², scaled so that its gradient is 1 on the sphere. At a distance d from the
        # middle of one of radius R it is (d² - R²) / 2R, and its slope d / R.
        scale = np.sqrt(np.maximum(np.einsum("mi,mi->m", slope, slope) - 4 * bend * level, np.finfo(float).tiny))
        slope, level = slope / scale[:, None], level / scale
        steep = np.linalg.norm(slope, axis=1)
        return 2 * level / (1 + steep), slope / np.where(steep > 0, steep, 1)[:, None], (distance, weight, near)
