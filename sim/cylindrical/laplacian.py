# SPDX-License-Identifier: GPL-3.0-or-later
"""The modified Laplacian field of a range map: where its creases and its edges are (Lee et al. 1995, section 2.1).

A plain Laplacian cancels where a crease runs over a ridge, as between the lips; here each direction's second difference
counts by itself, and in the field of creases only the hollow ones do.
"""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from .range_map import RangeMap


def second_differences(range_map: RangeMap, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Curvature along longitude and along height (h, w each, 1/mm, positive where hollow), smoothed over ``scale`` mm.

    The map must have no voids (`relaxation.filled`). Along the longitude the arc of the cylinder itself is left out.
    """
    radius = range_map.radius
    run = np.median(radius) * range_map.step
    around = "wrap" if range_map.closed else "nearest"
    smooth = gaussian_filter1d(radius, scale / range_map.rise, axis=0, mode="nearest")
    smooth = gaussian_filter1d(smooth, scale / run, axis=1, mode=around)
    left, right = np.roll(smooth, 1, axis=1), np.roll(smooth, -1, axis=1)
    if not range_map.closed:
        left[:, 0], right[:, -1] = smooth[:, 0], smooth[:, -1]
    above = np.concatenate([smooth[:1], smooth[:-1]])
    below = np.concatenate([smooth[1:], smooth[-1:]])
    along = (left + right - 2 * smooth) / (smooth * range_map.step) ** 2
    upright = (above + below - 2 * smooth) / range_map.rise**2
    return along, upright


def laplacian_field(range_map: RangeMap, scale: float = 2.5) -> np.ndarray:
    """(h, w) 1/mm, the positive field: large in creases (lips, eyes, beside the nose, under the chin), never negative."""
    along, upright = second_differences(range_map, scale)
    return np.maximum(along, 0) + np.maximum(upright, 0)


def edge_field(range_map: RangeMap, scale: float = 2.5) -> np.ndarray:
    """(h, w) 1/mm, the counterpart on edges: large on the nose, the chin, the rims of ears and lips, never negative."""
    along, upright = second_differences(range_map, scale)
    return np.maximum(-along, 0) + np.maximum(-upright, 0)
