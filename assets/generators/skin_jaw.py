# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of the jaw's turn each vertex of the reference skin takes part in: made for plain rotation about the hinge.

Only chin and lower lip hang on the mandible. Cheek and throat are stretched between them and what stays: nose,
cheekbone, ear and larynx; the skin slides over the bone there, so its share falls evenly from the one to the other, as
that of heads measured with open mouths does (ICT-FaceKit). Such an even fall is a harmonic field. The lips have shares
of their own, so that they open to an oval.
"""

import numpy as np

from .skin_layout import HALF, ROWS
from .skin_lips import lip_places

#: Opening of the lips by steps from the corner to the middle, 1 = all: an ellipse.
_OVAL = (0.0, 0.47, 0.66, 0.78, 0.87, 0.935, 0.975, 0.994, 1.0)

#: The same in the lining: in the fornix, on the ridges, which go with their bones, and on palate and floor behind.
_LINING = {
    8: (0.0, 0.42, 0.68, 0.85, 0.93, 0.97, 0.99, 1.0, 1.0),
    9: (0.0, 0.5, 0.9, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
    10: (0.0, 0.5, 0.9, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
    11: (0.0, 0.3, 0.6, 0.85, 0.97, 1.0, 1.0, 1.0, 1.0),
}

#: Chin: rows, and the last column that still goes with the bone in each.
_CHIN = ((22, 3), (23, 4), (24, 4), (25, 2))

#: The jaw line (row 24) behind the chin, from the column after it to the jaw's angle.
_JAW_LINE = (0.97, 0.93, 0.87, 0.79, 0.70, 0.60, 0.49, 0.38, 0.26)

#: Where the throat meets the neck (row 27), near the midline.
_THROAT = {27: 0.32}

#: Rounds of smoothing away the creases at these lines.
_ROUNDS = 2

#: How far the fall is levelled at both its ends, 0..1.
_EASE = 0.6


def _outside(p, lips: np.ndarray) -> np.ndarray:
    """(n,) share of the skin outside the lips."""
    layout = p.layout
    ring = layout.rings["mouth"]
    holes = ("eye_l", "eye_r", "ear_l", "ear_r", "nostril_l", "nostril_r")
    still = [
        layout.crown.ravel(),
        *(layout.rings[h].ravel() for h in holes),
        *(layout.patches[h].ravel() for h in holes),
    ]
    still += [p.grid(0, HALF, 0, 10), p.grid(0, 4, 10, 15), p.grid(17, HALF, 0, ROWS), p.grid(0, HALF, 30, ROWS)]
    chin = [p.grid(0, last, row, row) for row, last in _CHIN]
    line = [(p.grid(u, u, 24, 24), share) for u, share in enumerate(_JAW_LINE, 5)]
    throat = [(p.grid(0, 3, row, row), share) for row, share in _THROAT.items()]
    fall = p.field(
        (np.concatenate(still), 0), (np.concatenate(chin), 1), *line, *throat, (ring[3], lips), (ring[4:], 0.5)
    )
    fall += _EASE * (fall * fall * (3 - 2 * fall) - fall)
    degree = np.asarray(p.plain.sum(axis=1)).ravel()
    free = np.ones(layout.count, dtype=bool)
    free[np.concatenate([*still, *chin, ring[2:].ravel(), layout.patches["mouth"].ravel()])] = False
    for _ in range(_ROUNDS):
        fall = np.where(free, 0.5 * fall + 0.5 * (p.plain @ fall) / degree, fall)
    return fall


def jaw_weights(p, vertices: np.ndarray) -> np.ndarray:
    """(n,) share of the mandible's motion, 0..1, of each skin vertex.

    p : the painter of `skin_groups` (rings, grid places and harmonic fields); vertices : (n, 3) mm
    """
    layout = p.layout
    ring, patch = layout.rings["mouth"], layout.patches["mouth"]
    _, away, above = lip_places()
    lips = 0.5 - 0.5 * above * np.array(_OVAL)[away]
    out = _outside(p, lips)
    out[ring[3:8]] = lips
    for k in range(8, len(ring)):
        out[ring[k]] = 0.5 - 0.5 * above * np.array(_LINING[k])[away]
    out[patch[1, 1:-1]] = 0.5
    return out
