# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyeballs that a scan shows: the one sphere in a face. A skin laid on a scan with eyeballs takes them for lids."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from ..adapt.closest import Surface
from ..adapt.eye_frame import eye_frame

ASIDE, ACROSS, STEP = (
    20.0,
    14.0,
    0.6,
)  # mm to either side of an eye's middle, above and below it, and from place to place
SMOOTH = 1.0  # places over which the surface is smoothed before its normals are taken
#: mm: radii that are tried, and the spread of the centres that the normals of one sphere point to.
RADII, CENTRES = np.arange(8.5, 13.1, 0.5), 0.7
FACING = 0.5  # cosine between forward and the normal of a place that is looked at
ON, AGREE = 0.35, 0.97  # mm from a sphere, and cosine between normals, up to which a place lies on it
#: A sphere that is an eyeball: mm of radius (that of what is seen, the cornea and the white around it, is smaller than the
#: eyeball's), mm by which the scan strays from it, mm² of it that are seen. Eyeballs stray by .03-.06, all else by .07 or more.
RADIUS, STRAYS, SEEN = (7.5, 13.2), 0.065, 40.0
#: Two that are alike may stray more, where a scan is noisy: mm of radius, mm by which the scan strays, difference of the radii
#: against one, and mm between their places in their eyes. Noise of 0.2 mm makes eyeballs stray by .08; what else strays as
#: little is not alike.
ALIKE_RADIUS, ALIKE_STRAYS, ALIKE, ALIKE_PLACE = 11.0, 0.1, 0.12, 2.5
#: Of the radius, before and behind the sphere: a lid stands before it, the white falls back from a cornea.
BEFORE, BEHIND = 0.04, 0.1


@dataclass(frozen=True, eq=False)
class Ball:
    """middle (3,) and radius mm of a sphere; strays : mm, mean distance of what lies ``on`` it (r, c) bool."""

    middle: np.ndarray
    radius: float
    strays: float
    on: np.ndarray

    @property
    def is_eyeball(self) -> bool:
        """Whether it is one."""
        return RADIUS[0] < self.radius < RADIUS[1] and self.strays < STRAYS and self._seen

    @property
    def _seen(self) -> bool:
        return self.on.sum() * STEP**2 > SEEN

    def is_like(self, other: "Ball") -> bool:
        """Whether both are eyeballs because they are like each other."""
        small = all(ball.radius < ALIKE_RADIUS and ball.strays < ALIKE_STRAYS and ball._seen for ball in (self, other))
        near = np.abs(self.middle - other.middle)[:2].max() < ALIKE_PLACE
        return bool(small and near and abs(self.radius / other.radius - 1) < ALIKE)


@dataclass(frozen=True, eq=False)
class Eyeball:
    """middle (3,) mm in the scan, and radius mm."""

    middle: np.ndarray
    radius: float

    def shows(self, points) -> np.ndarray:
        """Which of the ``points`` (..., 3) mm of a scan are the eyeball's, the white beside the cornea included."""
        before = (np.linalg.norm(points - self.middle, axis=-1) - self.radius) / self.radius
        return (before > -BEHIND) & (before < BEFORE)


def eyeballs_seen(marks, matrix, target: Surface) -> dict[str, Eyeball]:
    """Side -> `Eyeball` of those that a scan shows.

    marks : name -> (3,) mm, about where ``en`` and ``ex`` lie; matrix (3, 3) turns and scales the reference into the scan
    """
    x, y = np.arange(-ASIDE, ASIDE + STEP / 2, STEP), np.arange(ACROSS, -ACROSS - STEP / 2, -STEP)
    balls, out = {}, {}
    for side in "lr":
        eye = eye_frame(marks, side, matrix)
        ball = sphere_in(x, y, eye.depth(target, eye.grid(x, y)))
        if ball is not None:
            balls[side] = ball
            axes = np.stack([eye.along, eye.up, eye.forward])
            out[side] = Eyeball(eye.middle + eye.scale * ball.middle @ axes, eye.scale * ball.radius)
    alike = len(balls) == 2 and balls["l"].is_like(balls["r"])
    return {side: out[side] for side, ball in balls.items() if alike or ball.is_eyeball}


def sphere_in(x, y, depth) -> Ball | None:
    """The sphere of an eyeball's size on which most of a surface lies; None: there is no surface.

    x (c,), y (r,) mm to the side and up, downward; depth (r, c) mm behind, NaN where there is nothing
    """
    there = np.isfinite(depth)
    filled, full = (gaussian_filter(np.where(there, value, 0.0), SMOOTH) for value in (depth, 1.0))
    smooth = np.where(there, filled / np.maximum(full, 1e-3), np.nan)
    down, across = np.gradient(smooth, STEP)
    normals = np.stack([across, -down, np.ones_like(across)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    points = np.stack([*np.meshgrid(x, y), -smooth], axis=-1)
    use = np.isfinite(normals).all(axis=-1) & there
    use[use] = normals[use][:, 2] > FACING
    p, n = points[use], normals[use]
    if len(p) < 4:
        return None
    votes = []
    for radius in RADII:
        centres = p - radius * n
        tree = cKDTree(centres)
        count = tree.query_ball_point(centres, CENTRES, return_length=True)
        most = count.argmax()
        votes.append((count[most], radius, centres[tree.query_ball_point(centres[most], CENTRES)].mean(axis=0)))
    _, radius, middle = max(votes, key=lambda vote: vote[0])
    for _ in range(4):
        on = _on_sphere(p, n, middle, radius)
        if on.sum() < 4:
            return None
        rows = np.column_stack([2 * p[on], np.ones(on.sum())])
        found = np.linalg.lstsq(rows, (p[on] ** 2).sum(axis=1), rcond=None)[0]
        middle, radius = found[:3], float(np.sqrt(max(found[3] + found[:3] @ found[:3], 0.0)))
    on = _on_sphere(p, n, middle, radius)
    if not on.any():
        return None
    strays = np.abs(np.linalg.norm(p[on] - middle, axis=1) - radius).mean()
    lies = np.zeros(depth.shape, dtype=bool)
    lies[use] = on
    return Ball(middle, radius, float(strays), lies)


def _on_sphere(points, normals, middle, radius):
    """Which of the points (k, 3) with their normals lie on a sphere."""
    arm = points - middle
    away = np.linalg.norm(arm, axis=1)
    return (np.abs(away - radius) < ON) & (np.einsum("ki,ki->k", arm, normals) > AGREE * away)
