# SPDX-License-Identifier: GPL-3.0-or-later
"""The auricle: a sculpt in its own frame, put on the head along its root and seen on the limit surface."""

import numpy as np
from scipy.interpolate import CubicSpline, RBFInterpolator
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import spsolve

from ...sim.mesh import edges
from ...sim.mesh_subdivision import limit
from .skin_ear_contours import BEFORE, CONTOURS, MIDDLE, ROOT
from .skin_layout import Layout

#: Turn of the auricle (degrees): its back edge away from the head, its top outward, its long axis backward.
FLARE, LEAN, TILT = 24.0, 6.0, 5.0

#: The contours' scale: what is seen, the limit surface, and the cage outside it then both have the length of the norms.
SIZE = 0.975

#: How far (mm) the plane of the auricle passes outside the tragion.
STAND = 5.0

#: Ring 1, the back of the auricle: index -> how far (mm) it stands off the head at least, for a groove behind the ear.
_GROOVE = {11: 2.6, 12: 3.2, 13: 4.0, 14: 4.4, 15: 4.6, 16: 4.6, 17: 4.4, 18: 4.0, 19: 3.0, 20: 2.0, 21: 1.0}

#: How much of what subdivision rounds off the cage of rings 1.. gives back at each step.
_CRISP = (0.0, 0.7, 0.8, 0.45, 0.6, 0.0, 0.0)

#: Skin around the ear that gives way when the root moves: within so many mm, seen from the side, of (y, z).
_AROUND, _MIDDLE = 62.0, (9.0, 0.0)


def contour(knots: dict[int, tuple], size: int = 24) -> np.ndarray:
    """(size, d): a closed cubic through ``knots`` index -> point, read at every index."""
    at = sorted(knots)
    points = np.array([knots[i] for i in at], float)
    curve = CubicSpline([*at, at[0] + size], np.concatenate([points, points[:1]]), bc_type="periodic")
    return curve((np.arange(size) - at[0]) % size + at[0])


def _around(layout: Layout, x: np.ndarray) -> np.ndarray:
    """Vertices of the head's left side around the ear, its root included."""
    inside = np.zeros(layout.count, dtype=bool)
    for rings in layout.rings.values():
        inside[rings[1:]] = True
    for patch in layout.patches.values():
        inside[patch] = True
    near = np.linalg.norm(x[:, 1:] - _MIDDLE, axis=1) < _AROUND
    return np.flatnonzero(near & (x[:, 0] > 20) & ~inside)


class Side:
    """The head's side without the ear, x = f(y, z) mm, through the skin around the ear (thin-plate spline)."""

    def __init__(self, layout: Layout, x: np.ndarray):
        points = x[_around(layout, x)]
        self._x = RBFInterpolator(points[:, 1:], points[:, 0], smoothing=2.0)

    def __call__(self, yz: np.ndarray) -> np.ndarray:
        return np.column_stack([self._x(yz), yz])


def frame(side: Side) -> tuple[np.ndarray, np.ndarray]:
    """Origin (3,) mm and rows (3, 3): the steps along p, q, h of the ear's frame."""
    flare, lean, tilt = np.radians([FLARE, LEAN, TILT])
    out = np.array([np.cos(flare) * np.cos(lean), -np.sin(flare) * np.cos(lean), -np.sin(lean)])
    back = np.array([np.sin(flare), np.cos(flare), 0.0])
    up = np.cross(out, back)
    p, q = np.cos(tilt) * back - np.sin(tilt) * up, np.cos(tilt) * up + np.sin(tilt) * back
    return side(np.zeros((1, 2)))[0] + [STAND, 0, 0], SIZE * np.array([p, q, out])


def _move_root(layout: Layout, x: np.ndarray, side: Side) -> None:
    """Ring 0 goes to the root of the auricle; the skin around it follows evenly, sliding on the head."""
    root = layout.rings["ear_l"][0]
    inner = _around(layout, x)
    step = np.zeros((layout.count, 2))
    step[root] = contour(ROOT) - x[root, 1:]
    pairs = edges(layout.faces)
    pairs = pairs[np.isin(pairs, inner).any(axis=1)]
    weight = 1 / np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1)
    ij = (np.r_[pairs[:, 0], pairs[:, 1]], np.r_[pairs[:, 1], pairs[:, 0]])
    link = coo_matrix((np.r_[weight, weight], ij), shape=(layout.count,) * 2).tocsr()
    laplacian = diags(np.asarray(link.sum(axis=1)).ravel()) - link
    free = np.setdiff1d(inner, root)
    fixed = np.setdiff1d(np.arange(layout.count), free)
    step[free] = spsolve(laplacian[free][:, free].tocsc(), -laplacian[free][:, fixed] @ step[fixed])
    old = x[inner, 1:]
    x[inner] += side(old + step[inner]) - side(old)
    x[root] = side(contour(ROOT))


def _sculpt(layout: Layout, x: np.ndarray, side: Side) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (k,) of the auricle and where (k, 3) mm its limit surface has them."""
    ring, patch = layout.rings["ear_l"], layout.patches["ear_l"]
    origin, axes = frame(side)
    size = ring.shape[1]
    index, target = [], []
    for k in range(1, len(ring)):
        knots = dict(CONTOURS[k])
        if k == 1:
            for i, (y, z, high) in BEFORE.items():
                knots[i] = tuple(axes @ (side(np.array([[y, z]]))[0] + [high, 0, 0] - origin) / SIZE**2)
        at = origin + contour(knots, size) @ axes
        if k == 1:
            back = list(_GROOVE)
            lack = list(_GROOVE.values()) - (at - side(at[:, 1:]))[back, 0]
            at[back, 0] += np.maximum(lack, 0)
        index.append(ring[k])
        target.append(at)
    index.append(patch[1:-1, 1])
    target.append(origin + np.array([MIDDLE[row] for row in sorted(MIDDLE)]) @ axes)
    return np.concatenate(index), np.concatenate(target)


def place_ear(layout: Layout, x: np.ndarray) -> None:
    """Put the auricle on a head whose grid is placed (left side)."""
    index, target = _sculpt(layout, x, Side(layout, x))
    x[index] = target


def finish_ear(layout: Layout, x: np.ndarray) -> None:
    """The auricle as sculpted, on the limit surface; its root where the sculpt leaves the head (left side)."""
    side = Side(layout, x)
    _move_root(layout, x, side)
    index, target = _sculpt(layout, x, side)
    x[index] = target
    smooth = limit(layout.faces, layout.count)[index]
    ring = layout.rings["ear_l"]
    gain = np.zeros(layout.count)
    for k, share in enumerate(_CRISP, start=1):
        gain[ring[k]] = share
    for _ in range(3):
        x[index] += gain[index, None] * (target - smooth @ x)
