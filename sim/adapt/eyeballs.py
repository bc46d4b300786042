# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyeballs stay spheres: their place and size follow from the lids that lie on them."""

import numpy as np

from ..anatomy.eyeball import reach
from ..anatomy.head import Eye
from .thin_plate_spline import similarity

SMALLEST, LARGEST = 9.5, 13.0  # mm: from a child of one year to a large adult eye
LID = 0.6  # mm of lid between the eyeball and the skin seen from outside


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
    near = np.flatnonzero((lid > 0.3) & (gap < 0.35 * eye.radius) & ((reference_skin - eye.centre) @ eye.gaze > 0))
    if len(near) < 6:
        return Eye(centre, radius, gaze), turn
    want = np.maximum(gap[near], np.where(inner[near], 0.1, LID))
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
    return Eye(centre, radius, gaze), turn


def carried_eyeball(vertices, old: Eye, new: Eye, turn) -> np.ndarray:
    """The eyeball's vertices (n, 3): the same rigid shape, scaled to the new radius and turned by ``turn`` (3, 3)."""
    return (vertices - old.centre) @ turn.T * (new.radius / old.radius) + new.centre


def lids_over(skin, eye: Eye, profile, rows, gap) -> np.ndarray:
    """Skin vertices (n, 3) with ``rows`` moved out of the eyeball to at least ``gap`` (rows,) mm above it."""
    out = np.array(skin)
    away = out[rows] - eye.centre
    length = np.linalg.norm(away, axis=1)
    angle = np.arccos(np.clip(away @ eye.gaze / np.maximum(length, 1e-9), -1, 1))
    need = profile(angle) + gap
    grow = np.maximum(need / np.maximum(length, 1e-9), 1.0)
    out[rows] = eye.centre + away * grow[:, None]
    return out


def profile_of(eye: Eye):
    """Callable: angle from the gaze (rad) -> how far the eyeball reaches there (mm); the cornea stands out."""
    return lambda angle: reach(eye, angle)
