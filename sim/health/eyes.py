# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyeballs are spheres, and the lids lie on them."""

import numpy as np

from ..adapt.closest import Surface
from ..adapt.openings import rims
from ..anatomy.head import Head
from ..anatomy.inside import inside

#: Along the way from the inner corner of the eye (0) to the outer one (1): where lids lie on the eyeball. The caruncle
#: fills the inner corner, and at the outer one the lids part from the ball.
BETWEEN = (0.24, 0.92)


def margin_rows(head: Head, side: str) -> np.ndarray:
    """Skin vertices (k,) of the inner edge of both lids' margins, between the corners of the eye ``side``."""
    lids = np.maximum(head.groups[f"lid_upper_{side}"], head.groups[f"lid_lower_{side}"]) > 0.3
    rows = np.flatnonzero(rims(head) & lids)
    marks = head.landmark_positions()
    inner, outer = marks[f"en_{side}"], marks[f"ex_{side}"]
    share = (head.skin.vertices[rows] - inner) @ (outer - inner) / ((outer - inner) @ (outer - inner))
    return rows[(share > BETWEEN[0]) & (share < BETWEEN[1])]


def lid_gaps(head: Head, side: str, skin=None) -> np.ndarray:
    """(k,) mm from the inner edge of the lids to the eyeball, negative inside it.

    ``skin`` (n, 3) mm: positions other than the skin's own, such as those of the limit surface.
    """
    points = (head.skin.vertices if skin is None else skin)[margin_rows(head, side)]
    ball = head.parts[f"eye_{side}"]
    distance = Surface(ball.vertices, ball.triangles).closest(points).distance
    return np.where(inside(points, ball.vertices, ball.triangles), -distance, distance)


def roundness(head: Head, side: str) -> float:
    """Largest deviation, mm, of the white of the eye from the sphere the head says it is."""
    ball, eye = head.parts[f"eye_{side}"], head.eyes["lr".index(side)]
    white = ball.faces[ball.material == 0]
    rows = np.unique(white[white >= 0])
    away = ball.vertices[rows] - eye.centre
    back = away @ eye.gaze < 0.5 * eye.radius  # in front the rim of the cornea stands out
    return float(np.abs(np.linalg.norm(away[back], axis=1) - eye.radius).max())
