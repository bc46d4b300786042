# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks that were not given are carried over from the reference by a warp (Kähler et al. 2002, 6.1).

With all landmarks in place a thin-plate spline would do; with a handful, on one side or in front only, its affine part
runs away. The warp here is a similarity plus a smooth displacement that is estimated like a random field (kriging): it
passes near the given landmarks, fades to the similarity away from them, leans towards a symmetric face, and allows
the few per cent of stretch by which heads differ in width, height and depth.
"""

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist

from ..anatomy.head import Head
from ..anatomy.landmark_names import SKIN, mirrored
from ..errors import InputError
from .thin_plate_spline import similarity

#: How surely a landmark is picked, mm (one standard deviation); all others are 1.5. Our own judgement.
SIGMA = {"eu": 6.0, "zy": 5.0, "go": 5.0, "ft": 5.0, "v": 5.0, "op": 5.0, "or": 4.0, "os": 3.0, "tr": 4.0, "t": 3.0} | {
    "obs": 3.0,
    "obi": 2.5,
    "pra": 2.5,
    "g": 2.5,
    "gn": 2.5,
    "pg": 2.5,
    "sci": 2.5,
    "n": 2.0,
}
AMPLITUDE = 6.0  # mm: how far a feature strays from the mean face, one standard deviation
RANGE = 55.0  # mm over which neighbouring features stray together
STRETCH = 0.05  # standard deviation of width, height and depth as a fraction
SYMMETRY = 0.9  # correlation of left and right


def sigma(name: str) -> float:
    """How surely landmark ``name`` is picked: one standard deviation in mm."""
    return SIGMA.get(name.removesuffix("_l").removesuffix("_r"), 1.5)


def mirror_plane(positions: dict[str, np.ndarray]):
    """The plane of symmetry of a set of landmarks: a point (3,) and the unit normal (3,) toward the subject's left."""
    pairs = [(n, mirrored(n)) for n in positions if n.endswith("_l") and mirrored(n) in positions]
    across = np.sum([positions[a] - positions[b] for a, b in pairs], axis=0)
    middle = [(positions[a] + positions[b]) / 2 for a, b in pairs]
    middle += [positions[n] for n in positions if not n.endswith(("_l", "_r"))]
    return np.mean(middle, axis=0), across / np.linalg.norm(across)


class Displacement:
    """The warp of this module: ``Displacement(reference, given)``, then ``.transform(points)``.

    reference : name -> (3,) mm, landmarks of the reference, all of them
    given : name -> (3,) mm, three or more landmarks of the target; unknown names are not looked at
    """

    def __init__(self, reference: dict[str, np.ndarray], given: dict[str, np.ndarray]):
        names = [n for n in reference if n in given]
        if len(names) < 3:
            raise InputError(f"{len(names)} landmarks are too few to place a head: give at least three.")
        p = np.array([reference[n] for n in names], dtype=float)
        q = np.array([given[n] for n in names], dtype=float)
        noise = np.array([sigma(n) for n in names])
        self._point, normal = mirror_plane(reference)
        # The reference's own axes: x across; the other two free.
        self._axes = np.linalg.svd(normal[None])[2]
        self._axes[0] = normal
        self._matrix, self._shift = similarity(p, q, 1 / (noise**2 + AMPLITUDE**2))
        self._size = float(np.cbrt(np.linalg.det(self._matrix)))
        rest = np.linalg.solve(self._matrix, (q - p @ self._matrix.T - self._shift).T).T @ self._axes.T
        self._at = self._local(p)
        self._weights = np.empty_like(rest)
        for axis in range(3):
            covariance = self._kernel(self._at, axis)
            covariance[np.diag_indices_from(covariance)] += (noise / 3) ** 2
            self._weights[:, axis] = cho_solve(cho_factor(covariance), rest[:, axis])

    def _local(self, points):
        return (np.asarray(points, dtype=float) - self._point) @ self._axes.T

    def _kernel(self, points, axis):
        """Covariance (k, n) of the displacement along ``axis`` between ``points`` and the given landmarks."""

        def plain(a, b):
            return AMPLITUDE**2 * np.exp(-cdist(a, b) / RANGE) + STRETCH**2 * np.outer(a[:, axis], b[:, axis])

        turned = points * np.array([-1.0, 1.0, 1.0])
        sign = -1.0 if axis == 0 else 1.0
        return plain(points, self._at) + sign * SYMMETRY * plain(turned, self._at)

    def transform(self, points) -> np.ndarray:
        """Points (k, 3) of the reference carried to the target, mm."""
        points = np.asarray(points, dtype=float).reshape(-1, 3)
        local = self._local(points)
        moved = np.stack([self._kernel(local, axis) @ self._weights[:, axis] for axis in range(3)], axis=1)
        return (points + moved @ self._axes) @ self._matrix.T + self._shift


def complete_positions(reference: dict[str, np.ndarray], given: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """All landmarks of ``reference``, in its order: the given ones as given, the others carried over (mm)."""
    warp = Displacement(reference, given)
    names = list(reference)
    carried = warp.transform(np.array([reference[n] for n in names]))
    return {n: np.array(given[n], dtype=float) if n in given else carried[k] for k, n in enumerate(names)}


def complete_landmarks(reference: Head, given: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """All 60 skin landmarks (name -> (3,) mm) from three or more given ones (Kähler et al. 2002, 6.1).

    Raises
    ------
    InputError : fewer than three landmarks.
    """
    positions = reference.landmark_positions()
    return complete_positions({n: positions[n] for n in SKIN if n in positions}, given)
