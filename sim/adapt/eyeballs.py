# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyeballs stay spheres: their place and size follow from the lids that lie on them."""

from typing import TYPE_CHECKING

import numpy as np

from ..anatomy.caruncle import caruncle_vertices
from ..anatomy.eyeball import BALL, reach
from ..anatomy.head import Eye, Head
from .thin_plate_spline import similarity

if TYPE_CHECKING:
    from .rest import Rest

SMALLEST, LARGEST = 9.5, 13.0  # mm: from a child of one year to a large adult eye
CORNERS, FADE = (0.06, 1.12), 0.12  # along an eye from its inner corner: where lids lie on the ball; fading in and out
BESIDE = (0.7, 0.35)  # how much of that holds for the seen lid one and two edges beside the rim
OUTSIDE = 0.8  # mm of lid between eyeball and seen skin, at least, where the reference has as much


def place_eye(eye: Eye, warped, reference_skin, fitted_skin, lid, inner, scale: float):
    """The eye (an `Eye`) for a fitted skin, and the rotation (3, 3) that takes the reference's eye to it.

    Parameters
    ----------
    eye : of the reference, mm
    warped : callable that carries points (k, 3) of the reference into the fitted head
    reference_skin, fitted_skin (n, 3) mm
    lid (n,) weights of both lids of this eye; inner (n,) bool: behind the lids
    scale : size of the fitted head relative to the reference
    """
    radius = float(np.clip(eye.radius * scale ** (0.6 if scale < 1 else 0.4), SMALLEST, LARGEST))
    # Points of the reference's sphere, carried along, tell place and direction.
    axes = np.concatenate([np.eye(3), -np.eye(3)]) * eye.radius + eye.centre
    turn, _ = similarity(axes, warped(axes))
    turn = turn / np.cbrt(np.linalg.det(turn))
    gaze = turn @ eye.gaze
    gaze = gaze / np.linalg.norm(gaze)
    centre = warped(eye.centre[None])[0]
    gap = np.linalg.norm(reference_skin - eye.centre, axis=1) - eye.radius
    front = (reference_skin - eye.centre) @ eye.gaze > 0
    near = np.flatnonzero((lid > 0.3) & ~inner & (gap < 0.35 * eye.radius) & front)
    if len(near) < 6:
        return _moved(eye, centre, radius, gaze), turn
    want = gap[near] * radius / eye.radius
    points, prior = fitted_skin[near], centre.copy()
    for _ in range(30):
        away = points - centre
        length = np.linalg.norm(away, axis=1)
        miss = length - radius - want
        # An eyeball through a lid is seen at once, a gap behind it is not.
        weight = np.where(miss < 0, 4.0, 1.0) / (1 + (miss / 1.5) ** 2)
        unit = away / length[:, None]
        system = (weight[:, None] * unit).T @ unit + 0.05 * len(near) * np.eye(3)
        step = np.linalg.solve(system, (weight * miss) @ unit + 0.05 * len(near) * (prior - centre))
        centre = centre + step
        if np.linalg.norm(step) < 1e-4:
            break
    return _moved(eye, centre, radius, gaze), turn


def _moved(eye, centre, radius, gaze):
    grow = radius / eye.radius
    return Eye(centre, radius, gaze, eye.iris_radius * grow, eye.pupil_radius * grow)


def eye_similarity(old: Eye, new: Eye, turn):
    """Callable that carries the eyeball: the same rigid shape, scaled to the new radius, turned by ``turn`` (3, 3)."""
    return lambda points: (points - old.centre) @ turn.T * (new.radius / old.radius) + new.centre


def eye_part(vertices, carried, eye: Eye, corner) -> np.ndarray:
    """The eye part (n, 3): the ball as ``carried`` takes it, the caruncle in the inner ``corner`` (3,) of the lids."""
    return np.concatenate([carried(vertices[:BALL]), caruncle_vertices(eye, corner)])


def height_over(points, eye: Eye, profile) -> np.ndarray:
    """(k,) mm from the eyeball out to points (k, 3), along the ray from its centre; ``profile`` as of `profile_of`."""
    away = points - eye.centre
    length = np.linalg.norm(away, axis=1)
    return length - profile(np.arccos(np.clip(away @ eye.gaze / np.maximum(length, 1e-9), -1, 1)))


def lids_on_eye(rest: "Rest", skin, eye: Eye, side: str) -> np.ndarray:
    """Skin (n, 3) whose lids lie on the eyeball as the reference's do on its own.

    The lids' backs and the inner edge of their margins keep their height over it, fading toward the corners of the
    eye; the outside of the lids keeps at least a lid's thickness.
    """
    head = rest.head
    old = head.eyes["lr".index(side)]
    profile = profile_of(old)
    lid = rest.lids(side) > 0.05
    start = head.skin.vertices
    height = height_over(start, old, profile)
    front = (start - old.centre) @ old.gaze > 0
    rows = np.flatnonzero(lid & front & (height < 0.4 * old.radius))
    if len(rows) == 0:
        return skin
    grow = eye.radius / old.radius
    now = height_over(skin[rows], eye, profile_of(eye))
    near = (rest.inner | rest.rim).astype(float)
    for share in BESIDE:
        near = np.maximum(near, share * (rest.link @ near > 0.99 * near[near > 0].min()))
    keep = near[rows] * _between_corners(head, start[rows], side)
    least = (
        np.where(
            rest.inner[rows],
            np.minimum(height[rows], 0.1),
            np.clip(0.6 * height[rows], np.minimum(height[rows], 0.05), OUTSIDE),
        )
        * grow
    )
    want = np.maximum(now + keep * (grow * height[rows] - now), least)
    out = np.array(skin)
    away = out[rows] - eye.centre
    length = np.linalg.norm(away, axis=1)
    out[rows] = eye.centre + away * ((length + want - now) / np.maximum(length, 1e-9))[:, None]
    return out


def _between_corners(head: Head, points, side: str):
    """(k,) 1 between the corners of the eye, where lids lie on the ball, 0 at them."""
    marks = head.landmark_positions()
    inner, outer = marks[f"en_{side}"], marks[f"ex_{side}"]
    share = (points - inner) @ (outer - inner) / ((outer - inner) @ (outer - inner))
    ends = np.minimum((share - CORNERS[0]) / FADE, (CORNERS[1] - share) / FADE)
    return np.clip(ends, 0, 1)


def profile_of(eye: Eye):
    """Callable: angle from the gaze (rad) -> how far the eyeball reaches there (mm); the cornea stands out."""
    return lambda angle: reach(eye, angle)
