# SPDX-License-Identifier: GPL-3.0-or-later
"""The warp of space that carries landmarks to landmarks (Kähler et al. 2002, section 5.1, equation 1).

``f(p) = sum_i c_i |p - p_i| + R p + t`` with ``sum c_i = 0`` and ``sum c_i p_i^T = 0``.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lu_factor, lu_solve
from scipy.spatial.distance import cdist

BLOCK = 100_000  # entries of the distance table held at once: few enough to stay in the cache of a core


def similarity(source, target, weights=None, mirror: bool | None = False):
    """The similarity ``x -> x @ A.T + t`` that best takes ``source`` (k, 3) to ``target`` (k, 3), k >= 1.

    Least squares after Umeyama 1991. One pair gives a translation, two add scale and the smallest turn.
    ``mirror``: False for a proper rotation, True for one with reflection, None for whichever fits better.
    Returns A (3, 3), t (3,).
    """
    source, target = np.atleast_2d(source).astype(float), np.atleast_2d(target).astype(float)
    weights = np.full(len(source), 1.0) if weights is None else np.asarray(weights, dtype=float)
    weights = weights / weights.sum()
    p0, q0 = weights @ source, weights @ target
    p, q = source - p0, target - q0
    spread = float(weights @ (p * p).sum(1))
    if len(source) == 1 or spread <= 1e-18:
        return np.eye(3), q0 - p0
    u, s, vt = np.linalg.svd(q.T @ (weights[:, None] * p))
    sign = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    wanted = sign if mirror is None else (-1.0 if mirror else 1.0)
    flip = np.array([1.0, 1.0, sign * wanted])
    if mirror is False and s[1] <= 1e-9 * s[0]:  # all on one line: the turn about it is free, take none
        rotation = least_turn(vt[0], u[:, 0])
        scale = s[0] / spread
    else:
        rotation = (u * flip) @ vt
        scale = float(s @ flip) / spread
    if scale <= 1e-9:
        rotation, scale = np.eye(3), float(np.sqrt((weights @ (q * q).sum(1)) / spread)) or 1.0
    matrix = scale * rotation
    return matrix, q0 - matrix @ p0


def least_turn(a, b):
    """Rotation by the smallest angle that takes unit vector ``a`` to ``b``."""
    v, c = np.cross(a, b), float(a @ b)
    if c < -1 + 1e-12:
        axis = np.linalg.svd(a[None])[2][1]
        return 2 * np.outer(axis, axis) - np.eye(3)
    k = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + k + k @ k / (1 + c)


def flatness(points) -> float:
    """Thickness of a set of points: smallest over largest standard deviation; 0 for points in a plane."""
    points = np.asarray(points, dtype=float)
    if len(points) < 3:
        return 0.0
    s = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(s[-1] / s[0]) if s[0] > 0 and len(s) == 3 else 0.0


@dataclass(frozen=True, eq=False)
class ThinPlateSpline:
    """A fitted warp: ``ThinPlateSpline.fit(source, target)``, then ``.transform(points)``.

    centres (n, 3) mm, the source landmarks; weights (n, 3), the c_i; matrix (3, 3) and shift (3,): R and t.
    """

    centres: np.ndarray
    weights: np.ndarray
    matrix: np.ndarray
    shift: np.ndarray

    @classmethod
    def fit(cls, source, target, smoothing=0.0, base: str = "affine") -> "ThinPlateSpline":
        """Fit to landmark pairs (n, 3) -> (n, 3), in mm.

        Parameters
        ----------
        smoothing : mm, one number or (n,); 0 passes through every landmark exactly, larger values let that landmark
            give way (added to the diagonal, negative because |r| is conditionally negative definite).
        base : ``affine`` is equation 1. ``similarity`` fits the best similarity first and leaves only the rest to the
            radial part with ``sum c_i = 0``; it is what fewer than four, or coplanar, landmarks get in any case,
            since they cannot tell shear from rotation.
        """
        source, target = (np.asarray(x, dtype=float).reshape(-1, 3) for x in (source, target))
        if source.shape != target.shape:
            raise ValueError(f"{len(source)} source landmarks do not pair with {len(target)} targets")
        if not (np.isfinite(source).all() and np.isfinite(target).all()):
            raise ValueError("landmarks must be finite numbers")
        if base == "similarity" or len(source) < 4 or flatness(source) < 1e-3:
            matrix, shift = similarity(source, target)
            return cls._about(source, target, matrix, shift, smoothing)
        return System(source, smoothing).solve(target)

    @classmethod
    def _about(cls, source, target, matrix, shift, smoothing=0.0):
        """Radial part for what the linear map ``matrix``, ``shift`` leaves over, with ``sum c_i = 0`` only."""
        rest = target - source @ matrix.T - shift
        n = len(source)
        system = np.ones((n + 1, n + 1))
        system[n, n] = 0
        system[:n, :n] = cdist(source, source)
        system[np.arange(n), np.arange(n)] -= np.broadcast_to(smoothing, n)
        right = np.zeros((n + 1, 3))
        right[:n] = rest
        if n < 4:
            return cls(source.copy(), np.zeros((n, 3)), matrix, shift)
        x = lu_solve(lu_factor(system, check_finite=False), right, check_finite=False)
        return cls(source.copy(), x[:n], matrix, shift + x[n])

    def transform(self, points) -> np.ndarray:
        """Warped points (k, 3), computed in blocks so that memory stays small."""
        points = np.asarray(points, dtype=float)
        flat = points.reshape(-1, 3)
        out = flat @ self.matrix.T + self.shift
        if self.weights.any():
            for part in blocks(len(flat), len(self.centres)):
                out[part] += cdist(flat[part], self.centres) @ self.weights
        return out.reshape(points.shape)


def blocks(rows: int, columns: int):
    """Slices of ``rows`` that make tables of at most `BLOCK` entries, or of one row."""
    step = max(1, BLOCK // max(columns, 1))
    return [slice(start, min(start + step, rows)) for start in range(0, rows, step)]


class System:
    """The matrix A of section 5.1 for one set of source landmarks, factorised: several targets cost one LU.

    source (n, 3) mm, four or more and not coplanar; smoothing as in `ThinPlateSpline.fit`.
    """

    def __init__(self, source, smoothing=0.0):
        self.source = np.array(source, dtype=float)
        n = len(self.source)
        self._centre = self.source.mean(axis=0)
        # Solved in units of the landmarks' own size: the system stays well conditioned in metres and millimetres.
        self._size = float(np.linalg.norm(self.source - self._centre, axis=1).max())
        p = (self.source - self._centre) / self._size
        system = np.zeros((n + 4, n + 4), order="F")  # the order in which LU needs no copy
        for part in blocks(n, n):
            system[:n, part] = cdist(p, p[part])
        system[np.arange(n), np.arange(n)] -= np.broadcast_to(smoothing, n) / self._size
        system[:n, n : n + 3] = p
        system[n : n + 3, :n] = p.T
        system[:n, n + 3] = system[n + 3, :n] = 1
        self._factors = lu_factor(system, overwrite_a=True, check_finite=False)

    def solve(self, target) -> ThinPlateSpline:
        """The warp to ``target`` (n, 3)."""
        n = len(self.source)
        right = np.zeros((n + 4, 3))
        right[:n] = target
        x = lu_solve(self._factors, right, check_finite=False)
        matrix = x[n : n + 3].T / self._size
        return ThinPlateSpline(self.source, x[:n] / self._size, matrix, x[n + 3] - matrix @ self._centre)


@dataclass(frozen=True, eq=False)
class WarpChain:
    """Several warps one after another."""

    warps: tuple = ()

    def then(self, warp) -> "WarpChain":
        """This chain with one more warp at its end."""
        return WarpChain((*self.warps, warp))

    def transform(self, points) -> np.ndarray:
        """Points (k, 3) after all warps."""
        points = np.array(points, dtype=float)
        for warp in self.warps:
            points = warp.transform(points)
        return points
