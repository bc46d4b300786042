# SPDX-License-Identifier: GPL-3.0-or-later
"""Lips laid on each other exactly, and what surrounds them smoothly after."""

import numpy as np
from scipy.sparse import coo_matrix, diags
from scipy.spatial import cKDTree

from ..adapt.rest import Rest
from ..adapt.smooth_system import factorised

#: Skin within the first distance of the lips, mm, gives way freely, beyond the second it hardly does.
NEAR, FAR = 10.0, 32.0
HOLD = 1.0  # pull toward where it was, of skin that hardly gives way
MEET = 200.0  # pull of a pair of points on each other


def lips_closed(rest: Rest, skin, matrix) -> np.ndarray:
    """Skin (n, 3) mm with each pair of lip points as far apart as on the reference.

    matrix (3, 3) turns and scales the reference into the skin's place. The displacement is the one of least bending.
    """
    upper, lower = rest.lip_pairs.T
    start = rest.head.skin.vertices
    n, k = len(start), len(upper)
    want = (start[upper] - start[lower]) @ matrix.T - (skin[upper] - skin[lower])
    place = (np.tile(np.arange(k), 2), np.concatenate([upper, lower]))
    apart = coo_matrix((np.repeat([1.0, -1.0], k), place), shape=(k, n)).tocsr()
    away = cKDTree(start[rest.lip_rim]).query(start)[0]
    share = np.clip((away - NEAR) / (FAR - NEAR), 0, 1)
    hold = 1e-4 + HOLD * share**2
    system = (rest.energy + diags(hold) + MEET * (apart.T @ apart)).tocsc()
    return skin + factorised(system)(MEET * (apart.T @ want))
