# SPDX-License-Identifier: GPL-3.0-or-later
"""A range map as a mesh, with holes where it has voids and where the surface jumps."""

import numpy as np

from ..mesh import Mesh
from .range_map import RangeMap
from .relaxation import relaxed

#: Rise of the radius over the distance of neighbouring texels above which there is no surface between them.
TEAR = 9.0


def to_mesh(range_map: RangeMap, tear: float | None = TEAR) -> Mesh:
    """One vertex per valid texel that is in a face; squares of texels as quads, three valid corners as a triangle.

    tear : faces steeper than this (rise over run, seen from the axis) are left out; None keeps them all. Positions in
    mm in the scan's place, wound to face outward; colours if the map has them, relaxed where they are unknown.
    """
    h, w = range_map.shape
    points, valid = range_map.points(), range_map.valid
    across = w if range_map.closed else w - 1
    i, j = np.divmod(np.arange((h - 1) * across), across)
    beside = (j + 1) % w
    corner = np.stack([i * w + j, (i + 1) * w + j, (i + 1) * w + beside, i * w + beside], axis=1)
    good = valid.ravel()[corner]
    radius = np.where(valid, range_map.radius, np.nan).ravel()
    if tear is not None:
        run = np.fmax(np.fmin.reduce(radius[corner], axis=1) * range_map.step, 1e-9)
        for k in range(4):  # a side that jumps has one corner too many: the nearer to the axis lies behind
            a, b = corner[:, k], corner[:, (k + 1) % 4]
            length = range_map.rise if k % 2 == 0 else run
            jump = np.abs(radius[a] - radius[b]) > tear * length
            nearer = np.where(radius[a] < radius[b], k, (k + 1) % 4)
            good[np.flatnonzero(jump), nearer[jump]] = False
    count = good.sum(axis=1)
    quads = corner[count == 4]
    three = corner[count == 3]
    lost = np.argmin(good[count == 3], axis=1)
    order = (lost[:, None] + np.arange(1, 4)) % 4
    faces = np.full((len(quads) + len(three), 4), -1, dtype=np.int64)
    faces[: len(quads)] = _split_short(quads, points.reshape(-1, 3))
    faces[len(quads) :, :3] = np.take_along_axis(three, order, axis=1)
    used = np.zeros(h * w, dtype=bool)
    used[faces[faces >= 0]] = True
    index = np.cumsum(used) - 1
    colour = None
    if range_map.colour is not None:
        colour = _known_colours(range_map).reshape(-1, 3)[used]
    return Mesh(points.reshape(-1, 3)[used], np.where(faces >= 0, index[faces], -1).astype(np.int32), colour=colour)


def _known_colours(range_map: RangeMap) -> np.ndarray:
    """(h, w, 3) colours without gaps where there is range: relaxed from those around (Lee et al. 1995, section 2.1)."""
    colour = range_map.colour
    known = np.isfinite(colour).all(axis=2)
    if known[range_map.valid].all():
        return np.where(np.isfinite(colour), colour, np.float32(0.5))
    if not known.any():
        return np.full(colour.shape, 0.5, dtype=np.float32)
    spacing = (float(np.nanmedian(range_map.radius)) * range_map.step, range_map.rise)
    return relaxed(colour, known, range_map.closed, 1.0, spacing).clip(0, 1).astype(np.float32)


def _split_short(quads, points):
    """Quads (q, 4) begun at such a corner that the diagonal 0-2 is the shorter."""
    first = np.linalg.norm(points[quads[:, 0]] - points[quads[:, 2]], axis=1)
    second = np.linalg.norm(points[quads[:, 1]] - points[quads[:, 3]], axis=1)
    return np.where((second < first)[:, None], np.roll(quads, -1, axis=1), quads)
