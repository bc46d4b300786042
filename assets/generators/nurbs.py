# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces of non-uniform rational B-splines (Piegl and Tiller, The NURBS Book, 1997: equations 2.5 and 4.15)."""

from typing import NamedTuple

import numpy as np


def clamped(count: int, degree: int = 2) -> np.ndarray:
    """Knots 0..1 for ``count`` control points, the ends reached and the rest evenly spaced."""
    inner = np.linspace(0, 1, count - degree + 1)
    return np.concatenate([np.zeros(degree), inner, np.ones(degree)])


def periodic(count: int) -> np.ndarray:
    """Knots of degree 2 for a closed row of ``count`` control points, wrapped as ``-1, 0 .. count - 1, 0, 1``.

    The row closes over parameters 0..1, where control point k weighs most at ``k / count``.
    """
    return (np.arange(count + 6) - 2.5) / count


def basis(knots: np.ndarray, at: np.ndarray, degree: int = 2) -> np.ndarray:
    """(len(at), n) values of the n = len(knots) - degree - 1 basis functions (Cox and de Boor's recursion)."""
    knots, at = np.asarray(knots, float), np.asarray(at, float)[:, None]
    end = np.flatnonzero(knots < knots[-1])[-1]  # the last span holds its right end too
    value = ((knots[:-1] <= at) & (at < knots[1:])).astype(float)
    value[at[:, 0] >= knots[-1], end] = 1.0
    for p in range(1, degree + 1):
        rise, fall = knots[p:-1] - knots[: -p - 1], knots[p + 1 :] - knots[1:-p]
        with np.errstate(divide="ignore", invalid="ignore"):
            left = np.where(rise > 0, (at - knots[: -p - 1]) / rise, 0.0)
            right = np.where(fall > 0, (knots[p + 1 :] - at) / fall, 0.0)
        value = left * value[:, :-1] + right * value[:, 1:]
    return value


class NurbsSurface(NamedTuple):
    """control (r, c, 3) mm, weights (r, c), knots of rows and of columns, degree."""

    control: np.ndarray
    weights: np.ndarray
    row_knots: np.ndarray
    column_knots: np.ndarray
    degree: int = 2

    @classmethod
    def tube(cls, control, weights=None) -> "NurbsSurface":
        """Rows of closed rings: control (r, c, 3), every ring periodic, the first and last ring reached."""
        control = np.asarray(control, float)
        weights = np.ones(control.shape[:2]) if weights is None else np.asarray(weights, float)
        wrap = np.r_[-1, np.arange(control.shape[1]), 0, 1]
        return cls(control[:, wrap], weights[:, wrap], clamped(len(control)), periodic(control.shape[1]))

    def grid(self, rows, columns) -> np.ndarray:
        """(len(rows), len(columns), 3) points at parameters 0..1 (equation 4.15)."""
        across = basis(self.column_knots, columns, self.degree)
        along = basis(self.row_knots, rows, self.degree)
        weighted = np.concatenate([self.control * self.weights[..., None], self.weights[..., None]], axis=2)
        point = np.einsum("ri,cj,ijk->rck", along, across, weighted)
        return point[..., :3] / point[..., 3:]
