# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin that no scanner sees goes with the organ it lines, and meets the seen skin without a crease.

Lid backs and the sac behind them turn and grow with the eyeball, the mouth bag with the teeth; from the rim inward
what the seen skin does besides dies away as the smoothest displacement would (bending energy, the bi-Laplacian).
"""

import numpy as np
from scipy.sparse import diags

from ..mesh_piercing import self_piercings
from ..mesh_subdivision import drawn
from .rest import MEET, Rest
from .smooth_system import factorised
from .thin_plate_spline import similarity

#: Pull toward the organ's own motion, by edges behind the rim (the last for all beyond).
PULL = {"eye_l": (0.02, 0.5, 3.0), "eye_r": (0.02, 0.5, 3.0), "mouth": (0.01, 0.3, 3.0)}

#: mm by which lips that cross are parted at a time, and how often at most.
PART, PARTINGS = 0.06, 8

#: Lips whose distance differs from the reference's by less than this share of it are left as they are.
ALIKE = 0.4


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


def lips_met(rest: Rest, skin, matrix) -> np.ndarray:
    """Skin (n, 3) whose lips lie on each other as the reference's do: apart by as much, and no more.

    matrix (3, 3) turns and scales the reference into the skin's place. Each pair keeps its middle, so the line on which
    the lips meet stays.
    """
    upper, lower = rest.lip_pairs.T
    start = rest.head.skin.vertices
    gap = start[upper] - start[lower]
    length = np.linalg.norm(gap, axis=1)
    off = gap @ matrix.T - (skin[upper] - skin[lower])
    # What a smooth warp does to them is right; only what is far from that is put right.
    wrong = np.linalg.norm(off, axis=1) - ALIKE * length
    share = np.clip(2 * (1 - length / MEET), 0, 1) * np.clip(wrong / np.maximum(ALIKE * length, 1e-9), 0, 1)
    half = share[:, None] * off / 2
    out = np.array(skin, dtype=float)
    out[upper] += half
    out[lower] -= half
    return out


def lips_parted(rest: Rest, skin, matrix) -> np.ndarray:
    """Skin (n, 3) whose lips do not cross each other, moved apart by as little as that takes where they do.

    Lips lie a tenth of a millimetre apart at their corners, so a smooth warp's twist is enough to cross them. ``matrix``
    (3, 3) turns and scales the reference into the skin's place. Where only the cage crosses itself, what nobody sees
    gives way, the margins and what lies behind them; the red of the lips only if the surface drawn crosses itself too.
    """
    faces, triangles = rest.head.skin.faces, rest.head.skin.triangles
    upper, lower = (np.asarray(rest.head.groups[name], dtype=float) for name in ("lip_upper", "lip_lower"))
    lips = triangles[np.maximum(upper, lower)[triangles].max(axis=1) > 0.3]
    way = PART * np.sign(upper - lower)[:, None] * (matrix @ [0.0, 0.0, 1.0])
    out = np.array(skin, dtype=float)
    for gives in ((rest.inner | rest.rim).astype(float), np.ones(len(out))):
        out = np.array(skin, dtype=float)
        for _ in range(PARTINGS):
            pairs = self_piercings(out, lips)
            if len(pairs) == 0:
                break
            crossed = np.zeros(len(out))
            crossed[lips[pairs.ravel()].ravel()] = 1.0
            out += (np.maximum(crossed, 0.5 * (rest.link @ crossed > 0)) * gives)[:, None] * way
        if len(self_piercings(drawn(faces, out), lips)) == 0:
            break
    return out
