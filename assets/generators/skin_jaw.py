# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of the jaw's motion each vertex of the reference skin takes part in."""

import numpy as np

from .skin_layout import HALF, ROWS

#: Jaw weight of the lip by steps from the mouth's corner downward: the opening becomes an oval.
_LIP_CORNER = (0.5, 0.73, 0.88, 0.97)


def _corners(p):
    """Lip and bag vertices near the corners with their jaw weights."""
    for step, weight in enumerate(_LIP_CORNER):
        yield p.ring("mouth", 3, 10, (19 - step, 3 + step)), weight
        yield p.ring("mouth", 3, 10, (19 + step, 3 - step)), 1 - weight


def jaw_weights(p, vertices: np.ndarray) -> np.ndarray:
    """(n,) share of the mandible's motion, 0..1, of each skin vertex.

    p : the painter of `skin_groups` (rings, grid places and harmonic fields); vertices : (n, 3) mm
    """
    lower, upper = range(7, 16), range(23, 32)
    return p.field(
        (p.layout.crown, 0),
        (p.grid(0, HALF, 0, 9), 0),
        (p.grid(0, 6, 9, 16), 0),
        (p.grid(0, HALF, 28, ROWS), 0),
        (p.grid(16, HALF, 0, ROWS), 0),
        (p.grid(13, 15, 0, 14), 0),
        (np.concatenate([p.ring(h + s, 0, None) for h in ("eye", "ear", "nostril") for s in ("_l", "_r")]), 0),
        (p.ring("mouth", 0, 10, upper), 0),
        (p.ring("mouth", 0, 0, (*range(22, 33),)), 0),
        (p.ring("mouth", 1, 10, lower), 1),
        *_corners(p),
        (p.grid(0, 6, 22, 25), 1),
        (p.grid(7, 10, 23, 25), 1),
        (p.grid(11, 13, 23, 25), 0.8),
        (p.layout.patches["mouth"][0], 0),
        (p.layout.patches["mouth"][1], 0.5),
        (p.layout.patches["mouth"][2], 1),
    )
