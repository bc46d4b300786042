# SPDX-License-Identifier: GPL-3.0-or-later
"""The lacrimal caruncle and the semilunar fold: the pink flesh in the inner corner of the eye.

They belong to the eye part but stay with the lids when the ball turns. The caruncle is about 5 mm high and 3 mm broad
(anatomy texts); the fold is the crescent between it and the white.
"""

import numpy as np

from ..mesh import Mesh
from .eyeball import flipped, lathe_faces
from .head import Eye

_AROUND, _RINGS = 12, 6
#: Caruncle: (from the corner toward the eye, behind the corner, up) and its half sizes the same way, mm.
_PLACE, _SIZE = (3.65, 1.8, 0.1), (1.65, 1.15, 1.1)
#: Semilunar fold: angle from the caruncle along the ball, rad; half sizes (along, off the ball, up), mm.
_FOLD, _FOLD_SIZE = 0.05, (0.9, 0.3, 1.5)


def caruncle(eye: Eye, corner: np.ndarray) -> Mesh:
    """Two closed pieces, mm, for the inner corner (3,) of the lids; mirrored eyes give mirrored meshes."""
    return Mesh(caruncle_vertices(eye, corner), _faces(_is_right(eye, corner)))


def caruncle_vertices(eye: Eye, corner: np.ndarray) -> np.ndarray:
    """(k, 3) mm: the vertices of `caruncle`, scaled with the eyeball and clear of it."""
    size = eye.radius / 12.0
    away = corner - eye.centre
    nasal = away - (away @ eye.gaze) * eye.gaze
    nasal /= np.linalg.norm(nasal)
    up = np.cross(eye.gaze, nasal) * (1.0 if _is_right(eye, corner) else -1.0)
    frame = np.stack([-nasal, -eye.gaze, up])
    middle = corner + size * np.array(_PLACE) @ frame
    body = _egg() * (size * np.array(_SIZE))
    body[:, 0] *= 1 - 0.12 * _egg()[:, 2] ** 2
    body[:, 2] *= 1 - 0.25 * np.clip(-_egg()[:, 0], 0, 1)  # it narrows toward the corner
    first = middle + body @ frame
    # the fold lies on the ball, a crescent that is open toward the iris
    toward = middle - eye.centre
    polar = np.arctan2(toward @ nasal, toward @ eye.gaze) - _FOLD
    lift = eye.radius + size * (0.25 + _FOLD_SIZE[1])
    egg = _egg() * (size * np.array(_FOLD_SIZE))
    bow = (egg[:, 2] / (size * _FOLD_SIZE[2])) ** 2
    angle = polar - (egg[:, 0] * (1 - 0.5 * bow) - 0.25 * size * bow) / eye.radius
    height = toward @ up + 0.1 * size + egg[:, 2]
    radius = np.sqrt(np.maximum((lift + egg[:, 1]) ** 2 - height**2, 1.0))
    second = (
        eye.centre
        + (radius * np.sin(angle))[:, None] * nasal
        + (radius * np.cos(angle))[:, None] * eye.gaze
        + height[:, None] * up
    )
    return np.concatenate([first, second])


def _is_right(eye, corner):
    up = np.array([0.0, 0.0, 1.0])
    return float((corner - eye.centre) @ np.cross(eye.gaze, up)) < 0


def _egg() -> np.ndarray:
    """A unit sphere (k, 3): rings about the upright axis, then the poles."""
    polar = np.linspace(0, np.pi, _RINGS + 2)[1:-1]
    turn = 2 * np.pi * np.arange(_AROUND) / _AROUND
    ring = np.stack([np.cos(turn), np.sin(turn), np.zeros(_AROUND)], axis=1)
    body = np.sin(polar)[:, None, None] * ring - np.cos(polar)[:, None, None] * np.array([0, 0, 1.0])
    return np.concatenate([body.reshape(-1, 3), [[0, 0, -1.0], [0, 0, 1.0]]])


def _faces(right: bool) -> np.ndarray:
    one = lathe_faces(_RINGS, _AROUND)
    both = np.concatenate([one, np.where(one < 0, -1, one + _RINGS * _AROUND + 2)])
    return (flipped(both) if right else both).astype(np.int32)
