# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 1 of the adaptation: the nose tip, the highest range in the middle of a face (Lee et al. 1995, section 2.2)."""

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter

from .range_map import RangeMap, reduced
from .relaxation import filled

#: Size of a nose tip and of the face around it, mm: what stands out between the two is looked for.
TIP, AROUND = 6.0, 22.0
#: A texel of the search, mm, and how far apart candidates are.
TEXEL, APART = 3.0, 25.0


def nose_candidates(range_map: RangeMap, count: int = 14, within: float = np.pi) -> np.ndarray:
    """(k, 2) rows and columns where the map stands out as a nose does, the most prominent first; k <= ``count``.

    within : rad from longitude 0. Hair, ears and chins stand out as well: the face around (`pose`) tells them apart.
    """
    run = float(np.nanmedian(range_map.radius)) * range_map.step
    by = (max(1, round(TEXEL / range_map.rise)), max(1, round(TEXEL / run)))
    small = reduced(range_map, by)
    known = small.valid
    full = filled(small, tension=1.0)
    run, around = run * by[1], "wrap" if full.closed else "nearest"

    def smooth(values, size):
        values = gaussian_filter1d(values, size / full.rise, axis=0, mode="nearest")
        return gaussian_filter1d(values, size / run, axis=1, mode=around)

    prominence = smooth(full.radius, TIP) - smooth(full.radius, AROUND)
    data = smooth(known.astype(float), TIP)
    prominence = np.where((data > 0.35) & (np.abs(full.longitudes) <= within), prominence, -np.inf)
    size = (2 * round(APART / full.rise / 2) + 1, 2 * round(APART / run / 2) + 1)
    peak = (prominence == maximum_filter(prominence, size, mode=("nearest", around))) & (prominence > 0.5)
    rows, columns = np.nonzero(peak)
    order = np.argsort(-prominence[rows, columns], kind="stable")[:count]
    at = np.column_stack([rows, columns])[order].astype(float)
    return at * by + (np.array(by) - 1) / 2


def nose_tip(range_map: RangeMap, row: float, column: float, reach: float = 12.0) -> tuple[float, float]:
    """The texel nearest by that reaches farthest out along the direction of (row, column), within ``reach`` mm."""
    points = range_map.points()
    start = range_map.place(row, column, np.nanmedian(range_map.radius))
    centre = range_map.origin + ((start - range_map.origin) @ range_map.axes[2]) * range_map.axes[2]
    ahead = (start - centre) / np.linalg.norm(start - centre)
    run = float(np.nanmedian(range_map.radius)) * range_map.step
    i, j = np.indices(range_map.shape)
    across = j - column
    if range_map.closed:
        across = (across + range_map.shape[1] / 2) % range_map.shape[1] - range_map.shape[1] / 2
    near = np.hypot((i - row) * range_map.rise, across * run) <= reach
    out = np.where(near & range_map.valid, (points - centre) @ ahead, -np.inf)
    if not np.isfinite(out).any():
        return float(row), float(column)
    i, j = np.unravel_index(int(out.argmax()), out.shape)
    return float(i), float(j)
