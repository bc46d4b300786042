# SPDX-License-Identifier: GPL-3.0-or-later
"""Do landmarks form a human face? Each is predicted from all the others, with how sure the prediction is.

A face is the reference's arrangement under a similarity of any pose and size plus a smooth random displacement (the
field of `completion`) plus the error of picking. Leaving one out of such a field has a closed form (Rasmussen and
Williams 2006, section 5.4.2, equation 5.12, here for three coordinates at once).
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from .completion import AMPLITUDE, RANGE, STRETCH, SYMMETRY, mirror_plane, sigma
from .thin_plate_spline import similarity

VAGUE = 1e4  # mm, standard deviation of place, turn and size: nothing is known about them
AGAIN = 8  # rounds in which landmarks that do not fit lose their say about the pose


@dataclass(frozen=True, eq=False)
class Likeness:
    """How landmarks compare with a face, lengths in mm on a head of the reference's size.

    off (k, 3) : given place less the place that all others predict; strange (k,) : that offset in standard deviations
    energy : what the arrangement costs as a whole, the square of standard deviations; about 3 k for a face
    scale : size relative to the reference
    """

    off: np.ndarray
    strange: np.ndarray
    energy: float
    scale: float


class Faces:
    """The family of all arrangements of the landmarks ``names`` of a ``reference`` (name -> (3,) mm)."""

    def __init__(self, reference: dict[str, np.ndarray], names: list[str]):
        self.names = list(names)
        self.places = np.array([reference[n] for n in self.names], dtype=float)
        sides = {n for n in reference if n.endswith("_l") and n[:-1] + "r" in reference}
        if sides:
            point, normal = mirror_plane(reference)
        else:
            point, normal = self.places.mean(axis=0), np.array([1.0, 0.0, 0.0])
        self._axes = np.linalg.svd(normal[None])[2]
        self._axes[0] = normal
        self._local = (self.places - point) @ self._axes.T
        self._precision = np.linalg.inv(self._covariance())

    def _covariance(self):
        """(3 k, 3 k), coordinates axis by axis."""
        p, k = self._local, len(self._local)
        noise = np.array([sigma(n) for n in self.names]) ** 2
        turned = p * np.array([-1.0, 1.0, 1.0])
        out = np.zeros((3 * k, 3 * k))
        for axis in range(3):
            sign = -1.0 if axis == 0 else 1.0

            def plain(a, axis=axis):
                return AMPLITUDE**2 * np.exp(-cdist(a, p) / RANGE) + STRETCH**2 * np.outer(a[:, axis], p[:, axis])

            part = slice(axis * k, (axis + 1) * k)
            out[part, part] = plain(p) + sign * SYMMETRY * plain(turned) + np.diag(noise)
        size = np.sqrt((p**2).sum(axis=1).mean())
        x, y, z = (p / size).T
        none, one = np.zeros(k), np.ones(k)
        pose = np.array(
            [
                np.concatenate(columns)
                for columns in (
                    (one, none, none),
                    (none, one, none),
                    (none, none, one),
                    (none, -z, y),
                    (z, none, -x),
                    (-y, x, none),
                    (x, y, z),
                )
            ]
        )
        return out + VAGUE**2 * pose.T @ pose

    def likeness(self, places: np.ndarray) -> Likeness:
        """How ``places`` (k, 3) mm of the landmarks, in any pose and size, compare with a face."""
        k = len(self.places)
        weights = np.ones(k)
        for _ in range(AGAIN):
            matrix, shift = similarity(self.places, places, weights)
            scale = float(np.cbrt(abs(np.linalg.det(matrix)))) or 1.0
            rest = np.linalg.solve(matrix, (places - self.places @ matrix.T - shift).T).T
            weights = 1 / (1 + (np.linalg.norm(rest, axis=1) / (2 * AMPLITUDE)) ** 2)
        value = (rest @ self._axes.T).T.ravel()
        pull = self._precision @ value
        blocks = self._precision.reshape(3, k, 3, k)[:, range(k), :, range(k)]  # (k, 3, 3)
        pulls = pull.reshape(3, k).T
        off = np.linalg.solve(blocks, pulls[..., None])[..., 0]
        strange = np.sqrt(np.maximum(np.einsum("ki,ki->k", pulls, off), 0))
        return Likeness(off @ self._axes, strange, float(value @ pull), scale)
