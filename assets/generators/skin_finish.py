# SPDX-License-Identifier: GPL-3.0-or-later
"""What averaging blurs is made crisp again: lids on the eyeball, lips that meet, nostrils, the relief of the ear.

All work in place on (n, 3) mm positions of the left side and the midline; `finish_shape` mirrors at the end.
"""

import numpy as np

from ...sim.mesh_subdivision import limit
from .skin_curves import lerp
from .skin_ear import finish_ear
from .skin_fit import fair, nose_end
from .skin_layout import HALF, ROWS, Layout
from .skin_lids import finish_lids
from .skin_lips import finish_lips
from .skin_mouth_bag import mouth_bag
from .skin_neck import finish_neck
from .skin_nose import finish_nose
from .skin_relief import raise_forms
from .skin_shape import both_sides


def _smooth_outside(layout: Layout, x: np.ndarray) -> np.ndarray:
    """The broad surfaces, freed of the facets of coarse heads; the face's features keep theirs."""
    weight = np.zeros(layout.count)
    for u in range(-HALF + 1, HALF + 1):
        for v in range(ROWS):
            vertex = layout.grid[v, u % (2 * HALF)]
            if vertex < 0:
                continue
            weight[vertex] = np.interp(abs(u), [5, 9], [0, 1])
            if abs(u) <= 8:
                weight[vertex] = max(weight[vertex], 0.6 * (v <= 2 or v >= 26))
    weight[layout.crown] = 1
    for side in ("_l", "_r"):
        weight[layout.rings["ear" + side][0]] = 0.3
    weight[layout.edge] = 0
    return fair(layout, x, weight, 7.0)


def _behind_ear(layout: Layout, x: np.ndarray) -> np.ndarray:
    """The auricle pulls on the few vertices behind it: smooth there again."""
    weight = np.zeros(layout.count)
    for v in range(1, 20):
        for u in range(14, HALF + 1):
            near = layout.grid[v, [u % (2 * HALF), -u % (2 * HALF)]]
            weight[near[near >= 0]] = np.interp(v, [0, 3, 17, 20], [0, 1, 1, 0]) * (v < 7 or u > 18)
    for side in ("_l", "_r"):
        weight[layout.rings["ear" + side][0]] = 0
    return fair(layout, x, weight, 13.0)


def _even_edge(layout: Layout, x: np.ndarray, rounds: int = 4) -> np.ndarray:
    """The bust ends in a line without waves, and so do the rows above it."""
    x = x.copy()
    for row, times in ((ROWS - 1, rounds), (ROWS - 2, rounds // 2)):
        loop = layout.row(row)
        for _ in range(times):
            x[loop] = 0.5 * x[loop] + 0.25 * (np.roll(x[loop], 1, axis=0) + np.roll(x[loop], -1, axis=0))
    return x


def _against_rounding(layout: Layout, x: np.ndarray, strength: float = 0.5) -> np.ndarray:
    """The end of the nose, which was not fitted in detail, stands out by what subdivision will round off it."""
    weight = nose_end(layout).astype(float)[:, None]
    weight[np.concatenate([layout.rings["nostril" + side][0] for side in ("_l", "_r")])] = 1
    smooth = limit(layout.faces, layout.count)
    out = x.copy()
    for _ in range(2):
        out += strength * weight * (x - smooth @ out)
    return out


def finish_shape(layout: Layout, vertices: np.ndarray) -> np.ndarray:
    """(n, 3) mm: an averaged head made whole, exactly symmetric."""
    x = both_sides(_even_edge(layout, _smooth_outside(layout, vertices))[layout.left])
    x = both_sides(_against_rounding(layout, x)[layout.left])
    raise_forms(layout, x)
    x = both_sides(x[layout.left])
    finish_ear(layout, x)
    x = both_sides(_behind_ear(layout, both_sides(x[layout.left]))[layout.left])
    finish_nose(layout, x)
    finish_neck(layout, x)
    ring = layout.rings["eye_l"]
    x[ring[1]] = lerp(x[ring[1]], x[ring[2]], 0.45)  # halves the way to the lids, whose rows lie close to the margins
    finish_lids(layout, x)
    finish_lips(layout, x)
    mouth_bag(layout, x)
    return both_sides(x[layout.left])
