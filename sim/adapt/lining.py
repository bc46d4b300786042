# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin that no scanner sees goes with the organ it lines, and meets the seen skin without a crease.

Lid backs and the sac behind them turn and grow with the eyeball, the mouth bag with the teeth; from the rim inward
what the seen skin does besides dies away as the smoothest displacement would (bending energy, the bi-Laplacian).
"""

import numpy as np
from scipy.sparse import diags

from .rest import Rest
from .smooth_system import factorised
from .thin_plate_spline import similarity

#: Pull toward the organ's own motion, by edges behind the rim (the last for all beyond).
PULL = {"eye_l": (0.02, 0.5, 3.0), "eye_r": (0.02, 0.5, 3.0), "mouth": (0.003, 0.05, 0.5, 3.0)}


def lined(rest: Rest, skin, organ: str, carried=None) -> np.ndarray:
    """Skin (n, 3) mm with the inner skin of ``organ`` (`Rest.organs`) put in its place.

    carried : callable, points (k, 3) of the reference -> where the organ takes them; None: where the rim's own
        surroundings do.
    """
    rows = rest.organs[organ]
    if len(rows) == 0:
        return skin
    out = np.array(skin, dtype=float)
    near = np.zeros(len(out), dtype=bool)
    near[rows] = True
    for _ in range(2):
        near |= rest.link @ near.astype(float) > 0
    near[rows] = False
    ring = np.flatnonzero(near)
    start = rest.head.skin.vertices
    if carried is None:
        matrix, shift = similarity(start[ring], skin[ring])

        def carried(points):
            return points @ matrix.T + shift

        pull = np.zeros(len(rows))
    else:
        strength = np.array(PULL[organ])
        pull = strength[np.clip(rest.behind[rows] - 1, 0, len(strength) - 1)]
    beside = skin[ring] - carried(start[ring])
    system = rest.energy[rows][:, rows] + diags(pull)
    out[rows] = carried(start[rows]) + factorised(system)(-(rest.energy[rows][:, ring] @ beside))
    return out
