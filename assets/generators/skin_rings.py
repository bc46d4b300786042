# SPDX-License-Identifier: GPL-3.0-or-later
"""First placing of the bust and of the rings around eyes, mouth, nostrils and ears along contours measured on the same head.

Ring vertices run as in `skin_layout.Block.perimeter`: on the left eye 2 is the inner and 14 the outer corner, 3..13 the
lower lid; around the mouth 3 is the right and 19 the left corner, 11 the middle below and 27 above.
"""

import numpy as np

from .skin_bust import place_bust
from .skin_ear import place_ear
from .skin_layout import Layout
from .skin_lids import place_lids
from .skin_lips import place_lips
from .skin_nose import place_nostril
from .skin_rays import MeasuredHead
from .skin_shape import both_sides


def place_rings(layout: Layout, grid: np.ndarray, head: MeasuredHead) -> np.ndarray:
    """(n, 3) mm: `skin_place.place_grid`'s positions completed by the bust, all rings and patches."""
    x = grid.copy()
    place_bust(layout, x, head)
    place_lids(layout, x, head)
    place_lips(layout, x, head)
    place_nostril(layout, x)
    place_ear(layout, x)
    return both_sides(x[layout.left])
