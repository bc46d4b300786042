# SPDX-License-Identifier: GPL-3.0-or-later
"""Lower neck, clavicles and shoulders down to the edge of the bust: rows that run from the neck outward and down.

Seen from a point inside the chest the surface hides nothing of itself, so every column follows a meridian of directions
about that point, from the row that ends the placed grid to the bust's edge, with rows at even distances.
"""

import numpy as np
from scipy.interpolate import PchipInterpolator

from ...sim.angles import bearing
from .skin_layout import HALF, Layout
from .skin_rays import MeasuredHead

#: The last row that `skin_place` places; the rows below it are the bust's.
NECK_ROW = 28

#: The point that sees it all, mm.
CENTRE = np.array([0.0, 50.0, -165.0])

#: Edge of the bust seen from there: longitude from the front and height above the horizon, degrees.
_EDGE = PchipInterpolator([0, 45, 70, 90, 110, 180], [-23, -17, -4, 12, 18, 20])

#: Longitude of the edge's vertices from the front midline to the back midline, degrees.
_EDGE_LONGITUDE = np.array([0, 13, 26, 38, 49, 58.5, 67, 75, 83, 91, 100, 110, 121, 134, 149, 164, 180.0])


def _kept(layout: Layout) -> np.ndarray:
    """(c,) columns of the left half that go down to the bust's edge."""
    return np.flatnonzero(layout.grid[-1, : HALF + 1] >= 0)


def bust_columns(layout: Layout) -> np.ndarray:
    """(c, r) vertices of the left half in the columns that go down to the edge, front midline first, from `NECK_ROW`."""
    return layout.grid[NECK_ROW:, _kept(layout)].T


def bust_between(layout: Layout) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices of the left half that lie under `NECK_ROW` in columns that end above the edge.

    Returns (k,) vertices, (k, 4) vertices of `bust_columns` round each, and (k, 4) their shares.
    """
    kept, columns = _kept(layout), bust_columns(layout)
    vertex, u, v = layout.places()
    between = (u >= 0) & (v > NECK_ROW) & ~np.isin(u, kept)
    vertex, u, v = vertex[between], u[between].astype(int), v[between] - NECK_ROW
    after = np.searchsorted(kept, u)
    across = (u - kept[after - 1]) / (kept[after] - kept[after - 1])
    above, down = v.astype(int), v % 1
    around = [columns[after - 1 + i, above + j * (down > 0)] for i in (0, 1) for j in (0, 1)]
    share = [(across if i else 1 - across) * (down if j else 1 - down) for i in (0, 1) for j in (0, 1)]
    return vertex, np.stack(around, axis=1), np.stack(share, axis=1)


def place_bust(layout: Layout, x: np.ndarray, head: MeasuredHead, steps: int = 24) -> None:
    """Bust rows of the left half and the midline, in place; row `NECK_ROW` must be there."""
    columns = bust_columns(layout)
    start = x[columns[:, 0]] - CENTRE
    first = np.degrees(bearing(start[:, 0], -start[:, 1]))
    first[[0, -1]] = 0, 180
    height = np.degrees(bearing(start[:, 2], np.hypot(start[:, 0], start[:, 1])))
    t = np.linspace(0, 1, steps)
    longitude = np.radians(first[:, None] + (_EDGE_LONGITUDE - first)[:, None] * t)
    up = np.radians(height[:, None] + (_EDGE(_EDGE_LONGITUDE) - height)[:, None] * t)
    way = np.stack([np.sin(longitude) * np.cos(up), -np.cos(longitude) * np.cos(up), np.sin(up)], axis=-1)
    for column, directions in zip(columns, way, strict=True):
        path = np.array([head.cast(CENTRE[None], d)[0] for d in directions])
        if np.isnan(path).any():
            raise ValueError("The measured head ends before the edge of the bust.")
        path[0] = x[column[0]]
        length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]
        at = np.linspace(0, length[-1], len(column))
        x[column] = np.stack([np.interp(at, length, path[:, k]) for k in range(3)], axis=1)
    x[columns[[0, -1]], 0] = 0
    vertex, around, share = bust_between(layout)
    x[vertex] = [head.cast(CENTRE[None], d)[0] for d in (x[around] * share[..., None]).sum(axis=1) - CENTRE]
