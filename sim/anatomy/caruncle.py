# SPDX-License-Identifier: GPL-3.0-or-later
"""The lacrimal caruncle and the semilunar fold: the pink flesh that fills the inner corner of the eye.

One pillow between the lids: a mound near the corner, about 5 mm long and 3 mm broad (anatomy texts), which passes into a
crescent that lies on the white and is open toward the iris. It belongs to the eye part but stays with the lids when the
ball turns; its rim is tucked in behind the edges of the lids.
"""

import numpy as np

from ..mesh import Mesh
from .eyeball import reach
from .head import Eye

#: Steps from the corner to the ball and from the lower lid to the upper.
ALONG, ACROSS = 12, 9
#: The flesh begins and ends at these shares of the way from the corner outward.
START, END = 0.05, 0.95
#: The rim keeps this far from the lids and the whole this far from the ball, mm.
FREE, CLEAR = 0.2, 0.14
#: Mound: place along the way, half length, height in mm. Crescent: the same, and how far it is open toward the iris, mm.
MOUND, FOLD, BOW = (0.42, 0.3, 1.1), (0.9, 0.1, 0.3), 0.9
#: Thickness of the flesh, mm.
THICK = 0.4


def caruncle(eye: Eye, lower: np.ndarray, upper: np.ndarray) -> Mesh:
    """The closed pillow, mm, between the backs of the lids.

    eye : the eyeball it lies beside
    lower, upper : (k, 3) mm, the lids' backs behind their edges, both from the inner corner of the eye outward
    """
    u, v = np.meshgrid(np.linspace(0, 1, ALONG), np.linspace(-1, 1, ACROSS), indexing="ij")
    low, high = (_curve(points, START + (END - START) * u[:, 0]) for points in (lower, upper))
    apart = high - low
    wide = np.linalg.norm(apart, axis=1, keepdims=True)
    inset = np.minimum(FREE * (0.8 + 0.7 * u[:, :1]) / np.maximum(wide, 1e-9), 0.35)
    low, high = low + inset * apart, high - inset * apart
    front = low[:, None] + 0.5 * (v + 1)[..., None] * (high - low)[:, None]
    corner = 0.5 * (lower[0] + upper[0])
    outward = 0.5 * (low[-1] + high[-1]) - corner
    outward -= (outward @ eye.gaze) * eye.gaze
    outward /= np.linalg.norm(outward)
    front = front - (BOW * u**2 * (1 - v**2))[..., None] * outward
    rim = (1 - v**4) * np.clip(4 * u, 0, 1) * np.clip(6 * (1 - u), 0, 1)
    back = _off(front - (THICK * rim)[..., None] * eye.gaze, eye, CLEAR)
    mound = MOUND[2] * np.exp(-(((u - MOUND[0]) / MOUND[1]) ** 2)) * (1 - v**2) ** 1.4
    fold = FOLD[2] * np.exp(-(((u - FOLD[0]) / FOLD[1]) ** 2)) * (1 - v**2) ** 0.5
    ray = front - eye.centre
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    toward = eye.gaze + (u**2)[..., None] * (ray - eye.gaze)
    front = front + ((mound + fold) * rim)[..., None] * toward
    front = _off(front, eye, CLEAR + 0.22 * rim)
    whole = np.concatenate([front.reshape(-1, 3), back[1:-1, 1:-1].reshape(-1, 3)])
    faces = _faces()
    right = float(outward @ np.cross(eye.gaze, [0.0, 0.0, 1.0])) > 0
    return Mesh(whole, faces[:, ::-1].copy() if right else faces)


def _curve(points, at):
    """(len(at), 3) along a polyline through ``points`` (k, 3), ``at`` 0..1 of its steps."""
    step = np.linspace(0, 1, len(points))
    return np.stack([np.interp(at, step, points[:, k]) for k in range(3)], axis=1)


def _off(points, eye, least):
    """Points (..., 3) mm at least ``least`` mm over the ball."""
    away = points - eye.centre
    far = np.linalg.norm(away, axis=-1)
    over = reach(eye, np.arccos(np.clip(away @ eye.gaze / far, -1, 1))) + least
    return eye.centre + away * (np.maximum(far, over) / far)[..., None]


def _faces() -> np.ndarray:
    """(m, 4) int32: a front and a back sheet that share their border."""
    front = np.arange(ALONG * ACROSS).reshape(ALONG, ACROSS)
    back = front.copy()
    back[1:-1, 1:-1] = front.size + np.arange((ALONG - 2) * (ACROSS - 2)).reshape(ALONG - 2, ACROSS - 2)
    sheets = []
    for table, way in ((front, 1), (back, -1)):
        quads = np.stack([table[:-1, :-1], table[1:, :-1], table[1:, 1:], table[:-1, 1:]], axis=-1).reshape(-1, 4)
        sheets.append(quads[:, ::way])
    return np.concatenate(sheets).astype(np.int32)
