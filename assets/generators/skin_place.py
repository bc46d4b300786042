# SPDX-License-Identifier: GPL-3.0-or-later
"""First placing of the flat layout on one head: thin-plate spline through control points, then an even net."""

import numpy as np
from scipy.sparse import coo_matrix, diags

from ...sim.adapt.thin_plate_spline import ThinPlateSpline
from ...sim.mesh import edges
from . import skin_controls
from .skin_bust import NECK_ROW
from .skin_layout import CROWN, Layout
from .skin_rays import MeasuredHead

#: Longitude (rad) of columns and height (mm) of rows on a plain egg: where the spline starts from.
_COLUMNS = ([0, 3, 5, 11, 13, 15, 19, 24], np.radians([0, 8, 17, 42, 65, 88, 118, 180]))
_ROWS = ([0, 5, 9, 15, 16, 22, 25, 27, NECK_ROW], [100, 37, -2, -31, -36, -70, -92, -105, -118])
_TOP, _RADIUS = 140.0, 90.0


def _egg_grid(u, v):
    longitude = np.interp(np.abs(u), *_COLUMNS) * np.sign(u)
    height = np.interp(v, *_ROWS)
    radius = np.sqrt(np.maximum(1 - (np.clip(height, 0, None) / _TOP) ** 2, 0)) * _RADIUS
    radius = np.where(height < -60, _RADIUS - (-60 - height) * 0.45, radius)
    return np.stack([radius * np.sin(longitude), -radius * np.cos(longitude), height], axis=-1)


def _egg_crown(border):
    """The crown patch between the columns of its own border, (CROWN + 1, CROWN + 1, 3)."""
    half = CROWN // 2
    x, y = np.meshgrid(np.linspace(-1, 1, CROWN + 1), np.linspace(-1, 1, CROWN + 1))
    m = np.maximum(np.abs(x), np.abs(y))
    safe = np.maximum(m, 1e-9)
    side = half * (2 + y / safe)
    back = half * (4 - np.abs(x) / safe)
    step = np.where(-y >= np.abs(x), half * np.abs(x) / safe, np.where(y >= np.abs(x), back, side))
    longitude = np.interp(np.interp(step, np.arange(2 * CROWN + 1), border), *_COLUMNS) * np.where(x < 0, -1, 1)
    radius = m * _RADIUS * np.sqrt(1 - (100 / _TOP) ** 2)
    height = _TOP * np.sqrt(1 - (radius / _RADIUS) ** 2)
    return np.stack([radius * np.sin(longitude), -radius * np.cos(longitude), height], axis=-1)


def _net(layout: Layout, placed: np.ndarray):
    """Neighbour averaging over the placed vertices; along open sides and hole borders only along the border."""
    pairs = edges(layout.faces)
    pairs = pairs[placed[pairs].all(axis=1)]
    n = layout.count
    link = coo_matrix(
        (np.ones(2 * len(pairs)), (np.r_[pairs[:, 0], pairs[:, 1]], np.r_[pairs[:, 1], pairs[:, 0]])), shape=(n, n)
    ).tocsr()
    borders = [rings[0] for rings in layout.rings.values()] + [layout.row(NECK_ROW)]
    on_border = np.zeros(n, dtype=bool)
    on_border[np.concatenate(borders)] = True
    rows = np.concatenate([np.tile(b, 2) for b in borders])
    cols = np.concatenate([np.r_[np.roll(b, 1), np.roll(b, -1)] for b in borders])
    along = coo_matrix((np.ones(len(rows)), (rows, cols)), shape=(n, n)).tocsr()
    link = (diags((~on_border).astype(float)) @ link + along).tocsr()
    link.data[:] = 1
    return diags(1 / np.maximum(np.asarray(link.sum(axis=1)).ravel(), 1)) @ link


def place_grid(layout: Layout, head: MeasuredHead, rounds: int = 10) -> np.ndarray:
    """(n, 3) mm: crown and grid down to `NECK_ROW` on the head, symmetric; nan for all others."""
    start = np.full((layout.count, 3), np.nan)
    vertex, u, v = layout.places()
    column = dict(zip(vertex.tolist(), u.tolist(), strict=True))
    start[layout.crown] = _egg_crown([abs(column[k]) for k in layout.row(0)[: 2 * CROWN + 1].tolist()])
    above = v <= NECK_ROW
    start[vertex[above]] = _egg_grid(u[above], v[above])
    assert all(layout.grid[v, u] >= 0 for u, v in skin_controls.GRID), "a control of a place without a vertex"
    index = [layout.grid[v, u] for u, v in skin_controls.GRID] + [layout.crown[j, i] for i, j in skin_controls.CROWN]
    points = head.controls([*skin_controls.GRID.values(), *skin_controls.CROWN.values()])
    index = np.r_[index, layout.mirror[index]]
    points = np.concatenate([points, points * [-1, 1, 1]])
    index, first = np.unique(index, return_index=True)
    points = points[first]
    placed = np.isfinite(start).all(axis=1)
    free = np.setdiff1d(np.flatnonzero(placed), index)
    out = start.copy()
    out[placed] = ThinPlateSpline.fit(start[index], points).transform(start[placed])
    out[index] = points
    out[free] = head.closest(out[free])
    out = 0.5 * (out + out[layout.mirror] * [-1, 1, 1])
    net = _net(layout, placed)
    weight = np.full((layout.count, 1), 0.06)
    weight[free] = 0.5
    anchor = out.copy()
    for _ in range(rounds):
        now = np.nan_to_num(out)
        pull = net @ now - now
        out[placed] += (weight * (0.2 * pull + 0.8 * (pull - net @ pull)))[placed]
        out[index] += 0.3 * (anchor[index] - out[index])
        out[placed] = head.closest(out[placed])
    return 0.5 * (out + out[layout.mirror] * [-1, 1, 1])
