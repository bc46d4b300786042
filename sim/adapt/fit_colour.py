# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of a heat map of the fit: a diverging scale in millimetres, grey where nothing was measured."""

import numpy as np

#: sRGB from far inside the scan over on it to far outside; light in the middle and equally dark at both ends.
SCALE = np.array([(0.13, 0.24, 0.62), (0.40, 0.63, 0.88), (0.96, 0.96, 0.94), (0.95, 0.62, 0.42), (0.68, 0.09, 0.15)])
INVENTED = np.array([0.36, 0.36, 0.37])
LIMIT = 0.5  # mm at the ends of the scale


def scale_colours(values: np.ndarray) -> np.ndarray:
    """(k, 3) sRGB for values (k,): -1 is the inside end of the scale, 0 its middle, 1 the outside end."""
    place = np.linspace(-1, 1, len(SCALE))
    values = np.clip(values, -1, 1)
    return np.stack([np.interp(values, place, channel) for channel in SCALE.T], axis=-1)


def fit_colours(distance: np.ndarray, fitted: np.ndarray, limit: float = LIMIT) -> np.ndarray:
    """(n, 3) sRGB for skin vertices ``distance`` (n,) mm from the scan (positive outside, NaN unknown).

    fitted (n,) 0..1 : what the warp invented is grey; limit : mm at the ends of the scale
    """
    known = np.isfinite(distance)
    colour = scale_colours(np.where(known, distance, 0.0) / max(limit, 1e-6))
    share = np.clip(3 * np.where(known, fitted, 0.0), 0, 1)[:, None]
    return (share * colour + (1 - share) * INVENTED).astype(np.float32)
