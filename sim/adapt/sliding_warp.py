# SPDX-License-Identifier: GPL-3.0-or-later
"""The warp through landmarks and through sites that may slide along the surface they were found on.

The nearest place on a scan says how far apart two surfaces are, not which points belong together: such a pair holds
across the surface, and along it the warp takes what is smoothest (semilandmarks that slide: Bookstein 1997; in three
dimensions Gunz, Mitteroecker and Bookstein 2005). The displacement is estimated like a random field, a Gaussian process
with a linear trend (Rasmussen and Williams 2006, equations 2.25 and 2.41), each observation with its own noise. Left and
right stray alike: what is known of one side of a face tells much of the other.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from .completion import AMPLITUDE
from .thin_plate_spline import blocks

TOGETHER = 40.0  # mm over which neighbouring features stray together
ALIKE = 0.8  # how much of that a place shares with its mirror image


def covariance(points, others):
    """(k, m) mm², single precision: of displacements at points (k, 3) and ``others`` (m, 3) mm. Matérn's with one
    derivative, which has no cusp at a landmark."""
    middle = others.mean(axis=0)
    a, b = ((np.sqrt(3) / TOGETHER * (at - middle)).astype(np.float32) for at in (points, others))
    # Their distances squared as one product: |a|² - 2 a b + |b|².
    left, right = np.ones((len(a), 5), np.float32), np.ones((5, len(b)), np.float32)
    left[:, :3], left[:, 3] = -2 * a, (a * a).sum(axis=1)
    right[:3], right[4] = b.T, (b * b).sum(axis=1)
    x = left @ right
    np.sqrt(np.maximum(x, 0, out=x), out=x)
    out = np.exp(-x)
    x += 1
    out *= x
    out *= np.float32(AMPLITUDE**2)
    return out


@dataclass(frozen=True, eq=False)
class Mirror:
    """A plane of symmetry: a ``point`` (3,) mm on it and its unit ``normal`` (3,)."""

    point: np.ndarray
    normal: np.ndarray

    def places(self, points):
        """Mirror images (k, 3) of points (k, 3)."""
        return points - 2 * ((points - self.point) @ self.normal)[:, None] * self.normal

    def ways(self, vectors):
        """The same of directions (k, 3)."""
        return vectors - 2 * (vectors @ self.normal)[:, None] * self.normal


@dataclass(frozen=True, eq=False)
class SlidingWarp:
    """A fitted warp: ``SlidingWarp.fit(...)``, then ``.transform(points)``.

    centres (k, 3) mm, with their mirror images; weights (k, 3); matrix (3, 3) and shift (3,) mm of the trend, which is
    added to the point itself
    """

    centres: np.ndarray
    weights: np.ndarray
    matrix: np.ndarray
    shift: np.ndarray

    @classmethod
    def fit(
        cls, marks, goals, frames, noise, sites, places, normals, slack, mirror: Mirror | None = None
    ) -> "SlidingWarp":
        """The warp that takes landmarks ``marks`` (k, 3) near ``goals`` (k, 3), and ``sites`` (m, 3) near the planes
        through ``places`` (m, 3) with unit ``normals`` (m, 3); all mm.

        frames (k, 3, 3) : orthonormal rows, the axes along which a landmark is as unsure as ``noise`` (k, 3) says; slack
        (m,) : the same of a site along its normal; mm, one standard deviation. Four landmarks or more, not coplanar. mirror :
        between left and right of ``marks`` and ``sites``; without it neither side tells of the other.
        """
        k, m = len(marks), len(sites)
        at = np.concatenate([marks, sites])
        middle, size = at.mean(axis=0), np.ptp(at, axis=0).max()
        # A landmark is observed along three axes, a site along one.
        way = np.concatenate([frames.reshape(-1, 3), normals])
        of = np.concatenate([np.repeat(np.arange(k), 3), k + np.arange(m)])
        seen = np.einsum("ij,ij->i", np.concatenate([goals - marks, places - sites])[of], way)

        def observed(others, ways):
            """(o, o) covariance of what is observed with the same at ``others`` along ``ways``."""
            return covariance(at, others).take(of, axis=0).take(of, axis=1) * (way @ ways.T)

        table = observed(at, way)
        if mirror:
            table += ALIKE * observed(mirror.places(at), mirror.ways(way))
        table[np.diag_indices_from(table)] += np.concatenate([noise.ravel(), slack]) ** 2
        terms = np.column_stack([np.ones(k + m), (at - middle) / size])
        trend = (way[:, :, None] * terms[of][:, None]).reshape(len(of), 12)
        factor = cho_factor(table.T, overwrite_a=True, check_finite=False)  # symmetric: as BLAS likes it, no copy
        rest = cho_solve(factor, np.column_stack([trend, seen]), check_finite=False)
        linear = np.linalg.solve(trend.T @ rest[:, :12], trend.T @ rest[:, 12])
        strength = rest[:, 12] - rest[:, :12] @ linear
        weights = np.zeros((k + m, 3))
        np.add.at(weights, of, way * strength[:, None])
        if mirror:
            at = np.concatenate([at, mirror.places(at)])
            weights = np.concatenate([weights, ALIKE * mirror.ways(weights)])
        linear = linear.reshape(3, 4)
        matrix = linear[:, 1:] / size
        return cls(at, weights, matrix, linear[:, 0] - matrix @ middle)

    def transform(self, points) -> np.ndarray:
        """Warped points (k, 3), computed in blocks so that memory stays small."""
        points = np.asarray(points, dtype=float)
        out = points + points @ self.matrix.T + self.shift
        weights = self.weights.astype(np.float32)
        for part in blocks(len(points), len(self.centres) // 2):  # single precision
            out[part] += covariance(points[part], self.centres) @ weights
        return out
