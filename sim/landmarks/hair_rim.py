# SPDX-License-Identifier: GPL-3.0-or-later
"""The rim of hair: where it rises from the forehead.

The outline of a face tells where hair begins only roughly. What it keeps of the hair, a step of some millimetres with a
ragged edge, became bumps on the forehead: next to hair, what stands higher than the skin beside it leads one to expect is hair.
"""

import numpy as np
from scipy.spatial import cKDTree

from ..adapt.closest import Surface
from .hidden_skin import EARLESS, SEEN, TRUSTED, likeliest_heights
from .shape_fit import ShapeFit, pairs
from .shape_space import ShapeSpace
from .under_hair import in_face, over

RIM = 16.0  # mm from hair
#: mm higher than expected, from which on it is hair: within the face's outline, where much of it may be skin, and outside.
IN_FACE, HIGHER = 5.0, 1.0
MOST = 0.5  # of what lies over a point of the skin
#: mm, how far about the rim skin is looked at, and of its heights their deviation and how far they go together. One kind, not
#: two as of skin that nothing shows: the rim is next to what is seen, and how high hair rises above that was set with this.
ABOUT, HEIGHTS = 60.0, (4.0, 25.0)
BESIDE = 8.0  # mm outside of that outline, which tells only roughly where hair begins


def rim_of_hair(
    space: ShapeSpace, fit: ShapeFit, target: Surface, hair, out, bare, given
) -> tuple[np.ndarray, np.ndarray]:
    """(m,) bool, the triangles of the scan ``target`` that rise to hair and are no skin, and (n,) bool, the points of the skin
    below them.

    hair (n,) bool : points of the skin over which hair probably is; out (n,) bool : those over which it is left out anyway
    bare (n,) bool : those that are not looked at; given : name -> (3,) mm, landmarks
    """
    none = np.zeros(len(target.triangles), dtype=bool), np.zeros(len(fit.points), dtype=bool)
    if not hair.any():
        return none
    away = cKDTree(space.points[hair]).query(space.points)[0]
    rim = (away < RIM) & ~bare
    place, trust, normals = pairs(space, fit.points, target, 2 * SEEN * fit.pose.scale)
    known = np.flatnonzero((away >= RIM) & (away < RIM + ABOUT) & (trust > TRUSTED) & (space.ear < EARLESS))
    if not rim.any() or len(known) == 0:
        return none
    off = np.einsum("ij,ij->i", place[known] - fit.points[known], normals[known])
    expected = np.zeros(len(fit.points))
    expected[rim] = likeliest_heights(space.points[known], off, space.points[rim], HEIGHTS)
    _, near, _, high = over(fit, space, target)
    on = (near >= 0) & rim[near]
    least = np.where(in_face(space, fit, given, BESIDE), IN_FACE, HIGHER) * fit.pose.scale
    rising = on & (high - expected[near] > least[near])
    count = np.bincount(near[on], minlength=len(rim))
    below = np.bincount(near[rising], minlength=len(rim)) > MOST * count
    return rising | (on & below[near]), below & ~out
