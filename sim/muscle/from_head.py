# SPDX-License-Identifier: GPL-3.0-or-later
"""A head's muscles as muscle vectors, ellipses and sheets in its skin (Waters 1986, 4.3: positioned after anatomy).

Origins and insertions are carried out to the skin, so that a vector lies in what it pulls. What the thesis sets by hand
for each muscle (zone, start and end of the fall-off) follows from how far apart a muscle's fibres end.
"""

import numpy as np

from ..anatomy.head import Head, Muscle
from ..tissue.geometry import Surface, short_diagonals
from .linear import LinearMuscle
from .sheet import SheetMuscle
from .sphincter import Sphincter

#: mm of skin that goes along beside and beyond the ends of a muscle's fibres.
_BESIDE, _BEYOND = 18.0, 18.0
#: mm of a muscle vector, at least, and of a sheet at most.
_SHORTEST, _LONGEST = 12.0, 70.0
#: How far beyond its fibres a ring round the eye reaches, as a share of its own size, and an arc of the lips.
_RING, _ARC = 1.45, (1.4, 2.3)
#: What the lips are pushed out by the sphincter, as a share of Ly.
_POUT = 0.16


def muscles_in_skin(head: Head) -> list[LinearMuscle | SheetMuscle | Sphincter]:
    """One for each of the head's muscles, in their order, at full ``spring``."""
    outer = _seen(head)
    return [_in_skin(muscle, outer) for muscle in head.muscles]


def _seen(head: Head) -> Surface:
    """The skin without what lies inside mouth, lids and nostrils."""
    triangles = short_diagonals(head.skin.vertices, head.skin.faces)
    inner = np.asarray(head.groups.get("inner", np.zeros(len(head.skin.vertices)))) > 0.5
    return Surface(head.skin.vertices, triangles[~inner[triangles].any(axis=1)])


def _in_skin(muscle: Muscle, skin: Surface):
    if muscle.kind == "sphincter":
        return _sphincter(muscle)
    end = skin.closest(muscle.fibres[:, -1])[0]
    tail = end.mean(axis=0)
    length = np.linalg.norm(np.diff(muscle.path, axis=0), axis=1).sum()
    # a sheet leaves for where its middle lies, not through the forehead
    start = muscle.fibres.shape[1] // 2 if muscle.kind == "sheet" else 0
    way = skin.closest(muscle.fibres[:, start])[0].mean(axis=0) - tail
    if np.linalg.norm(way) < 0.5 * np.linalg.norm(muscle.path[start] - muscle.path[-1]):
        way = muscle.path[start] - muscle.path[-1]  # it comes straight out of the bone
    length = np.linalg.norm(way) if muscle.kind == "linear" else min(length, _LONGEST)
    length = max(float(length), _SHORTEST)
    head = tail + length * way / np.linalg.norm(way)
    along, across = _spread(end, way)
    if muscle.kind == "sheet":
        return SheetMuscle(head, tail, across + _BESIDE, along + _BEYOND)
    zone = float(np.arctan2(across + _BESIDE, length))
    return LinearMuscle(head, tail, zone, length, length + along + _BEYOND)


def _spread(ends: np.ndarray, way: np.ndarray) -> tuple[float, float]:
    """How far ``ends`` (f, 3) reach from their middle along the direction ``way`` (3,) and across it, mm."""
    way = way / np.linalg.norm(way)
    away = ends - ends.mean(axis=0)
    along = away @ way
    return float(np.abs(along).max()), float(np.linalg.norm(away - along[:, None] * way, axis=1).max())


def _sphincter(muscle: Muscle) -> Sphincter:
    """The ellipse through a ring's outermost fibre, or round the mouth through the ends of an arc."""
    centre = muscle.centre if muscle.centre is not None else muscle.path.mean(axis=0)
    points = muscle.fibres.reshape(-1, 3)
    if muscle.ring:  # in the plane that it lies in
        out = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][2]
        across = np.array([1.0, 0.0, 0.0])
    else:
        across = muscle.path[-1] - muscle.path[0]
        out = np.cross(across, [0.0, 0.0, 1.0])
    out /= -np.linalg.norm(out) * np.sign(out[1])  # out of the face
    across = across - (across @ out) * out
    across /= np.linalg.norm(across)
    frame = np.array([across, np.cross(out, across), out])
    x, y = np.abs((points - centre) @ frame[:2].T).T
    if muscle.ring:
        return Sphincter(centre, frame, (_RING * x.max(), _RING * y.max()))
    return Sphincter(centre, frame, (_ARC[0] * x.max(), _ARC[1] * y.max()), pout=_POUT)
