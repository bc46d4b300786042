# SPDX-License-Identifier: GPL-3.0-or-later
"""What a person's jaw and muscles do otherwise than ours: a Gaussian process over the skin.

Its deviation is a share of what ours do. The jaw is a rigid bone: skin that follows it wholly does so in everybody, and
skin that does not stays in everybody; only between the two, at the cheeks and corners of the mouth, people differ as they
do in their muscles. Those pull along the same way more or less than ours, and in other ways; both sides mostly alike.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from ..anatomy.head import Jaw
from ..tissue.jaw import jaw_transform
from .responses import Responses

#: Deviation as a share of what our muscles do: to any side, and more or less of the same.
ASIDE, ALONG = 0.25, 0.25
RIGID = 0.15  # the same of what follows the jaw as a whole
#: Its reaches in mm with their shares of the variance.
REACHES = ((12.0, 0.3), (6.0, 0.7))
LEAST = 0.4  # mm of deviation where little moves, at the mouth
EVEN = 0.8  # correlation between the sides
MIRROR = np.array([-1.0, 1, 1])
#: Opening of the jaw at which distances are taken: closed lips touch, but what moves one does not move the other.
PARTED = 0.35


@dataclass(frozen=True, eq=False)
class Unlike:
    """places (n, 3) mm : the skin with its lips parted; aside (n,) mm : deviation to any side; along (n, 3) mm : the same
    along the way of the muscles."""

    places: np.ndarray
    aside: np.ndarray
    along: np.ndarray

    def covariance(self, rows, others=None) -> np.ndarray:
        """(3 a, 3 b) mm² between what ``rows`` (a, n) sparse and ``others`` (b, n) give of the skin; None: every vertex,
        and the same as ``rows``."""
        one = self._at(rows)
        other = one if others is None else self._at(others)
        near, across = likeness(one[0], other[0]), EVEN * likeness(one[0], other[0] * MIRROR)
        size = one[1][:, None] * other[1][None, :]
        out = np.kron(near * size, np.eye(3)) + np.kron(across * size, np.diag(MIRROR))
        return out + np.einsum("ik,jl,ij->ikjl", one[2], other[2], near + across).reshape(out.shape)

    def _at(self, rows):
        fields = (self.places, self.aside, self.along)
        return fields if rows is None else tuple(rows @ field for field in fields)


def unlike(table: Responses, fields, vertices, jaw: Jaw, opening: float, contraction) -> Unlike:
    """`Unlike` of a skin (n, 3) mm whose ``jaw`` is open by ``opening`` and whose muscles, ``fields`` (k, n, 3) mm, contract
    by ``contraction`` (k,)."""
    places = vertices + table.jaw_at(PARTED)
    moved = ((np.linalg.norm(fields, axis=2) * contraction[:, None]) ** 2).sum(axis=0)
    by_jaw = table.jaw_at(opening)
    turn, shift = jaw_transform(jaw, min(opening, 1.0))
    left = vertices @ turn.T + shift - vertices - by_jaw
    whole, between = (np.einsum("ij,ij->i", x, x) for x in (by_jaw, left))
    near = np.clip(table.reach / 6.0, 0, 1)
    aside = ASIDE**2 * (moved + np.minimum(whole, between)) + RIGID**2 * whole + (LEAST * near) ** 2
    # At the midline both sides add up to no more than elsewhere.
    once = 1 / np.sqrt(1 + EVEN * correlation(((places - places * MIRROR) ** 2).sum(axis=1)))
    along = ALONG * np.einsum("k,knj->nj", contraction, fields)
    return Unlike(places, np.sqrt(aside) * once, along * once[:, None])


def likeness(a, b) -> np.ndarray:
    """(j, k) correlation between points (j, 3) and (k, 3) mm."""
    return correlation(cdist(a, b, "sqeuclidean"))


def correlation(apart) -> np.ndarray:
    """Correlation at squared distances, mm²."""
    return sum(share * np.exp(-apart / (2 * reach**2)) for reach, share in REACHES)
