# SPDX-License-Identifier: GPL-3.0-or-later
"""The auricle: seven rings from its root over helix, scapha and antihelix into the concha."""

import numpy as np

from ...sim.mesh import Mesh, vertex_normals
from .skin_curves import lerp, unit
from .skin_layout import Layout

#: Ear rings, 24 vertices from the upper front corner down the front, along the lobe, up the back: (y, z) mm.
EAR_RIM = [
    *[(0, 19.5), (-1, 14), (-1.6, 8.5), (-1.2, 3), (-1.2, -3), (-2.6, -8), (-5, -14), (-7, -20), (-7.6, -25.5)],
    *[(-4, -28.8), (2, -29.3), (8, -26.8), (14, -21.5), (18.5, -16), (21.8, -10), (24, -4), (25.3, 3), (25.4, 9)],
    *[(24.2, 15), (21.8, 20.3), (18.2, 24.6), (13.5, 27.2), (8, 27.4), (3, 24.4)],
]

EAR_ANTIHELIX = [
    *[(4, 13), (3.2, 9.5), (2.2, 6), (1.6, 2.5), (1.4, -2), (0.4, -6.5), (-0.6, -10), (-0.4, -12.5), (0.6, -14)],
    *[(2.5, -14.6), (4.5, -14.6), (7, -13.6), (9.5, -11.6), (12, -9), (14, -6), (15.5, -2.5), (16.3, 1), (16.3, 4.5)],
    *[(15.5, 8), (14.2, 11), (12.3, 13.5), (10, 15), (7.8, 15.3), (5.6, 14.7)],
]

EAR_CONCHA = (6.0, -2.0)


def place_ear(layout, x, head):
    ring = layout.rings["ear_l"]
    root = x[ring[0]]
    i = np.arange(24)
    rim, fold = np.array(EAR_RIM, float), np.array(EAR_ANTIHELIX, float)
    concha, middle = np.array(EAR_CONCHA), np.array([8.0, 0.0])
    edge = lerp(rim, middle, 0.04)
    x[ring[3]] = head.left(edge)
    for k, flat in (
        *((4, lerp(rim, fold, 0.45)), (5, fold)),
        *((6, lerp(fold, concha, 0.3)), (7, lerp(fold, concha, 0.62))),
    ):
        x[ring[k]] = head.left(flat)
    behind = np.interp(i, [0, 7, 9, 11, 20, 22, 24], [0, 0, 0.5, 1, 1, 0.6, 0.2])
    base = np.column_stack([root[:, 0] - 0.5, lerp(rim, np.array([3.0, 0.0]), 0.42)])
    x[ring[1]] = lerp(head.left(lerp(root[:, 1:], rim, 0.55)), base, behind)
    back = x[ring[3]] + np.column_stack([np.full(24, -4.5), lerp(rim, middle, 0.10) - edge])
    x[ring[2]] = lerp(head.left(lerp(root[:, 1:], rim, 0.82)), back, behind)
    patch = layout.patches["ear_l"]
    x[patch[1:-1, 1]] = 0.5 * (x[patch[1:-1, 0]] + x[patch[1:-1, 2]]) - [1.0, 0, 0]


#: Ear ring -> (indices, mm): how far out of the auricle's plane the relief goes.
_EAR_RELIEF = (
    (5, [0, 3, 7, 8, 10, 12, 14, 17, 19, 20, 22, 23], [0.3, 0, 0, 1.2, 1.8, 0.6, 1.0, 1.4, 1.8, 1.8, 0.9, 0.5]),
    (4, [0, 1, 7, 11, 12, 14, 22, 23], [-0.7, 0, 0, 0, -0.7, -1.0, -1.1, -0.8]),
    (3, [0, 1, 2, 3, 4, 5, 6, 7, 11, 13, 22, 23], [0.2, 0, 0.1, 0.7, 1.2, 0.8, 0.1, 0, 0, 0.5, 0.7, 0.4]),
    (6, [0, 23], [-0.8, -0.8]),
    (7, [0, 23], [-2.2, -2.2]),
)


def finish_ear(layout: Layout, x: np.ndarray) -> None:
    """Helix, scapha, antihelix, antitragus, tragus, concha."""
    ring = layout.rings["ear_l"]
    normal = vertex_normals(x, Mesh(x, layout.faces).triangles)
    out = unit(normal[ring[4:7]].sum(axis=(0, 1)))
    out = unit(np.array([out[0], min(out[1], 0), 0.05]))
    for k, at, mm in _EAR_RELIEF:
        x[ring[k]] += np.interp(np.arange(24), at, mm)[:, None] * out
    x[ring[3][3:6]] += [0.5, 0.6, 0]
    for k, drop in zip(range(1, 7), (0.8, 1.2, 1.8, 2.6, 1.8, 1.0), strict=True):  # behind the tragus it falls off
        crest = x[ring[3][k]]
        x[ring[4][k]] = crest + [-drop, 0.8, -0.1]
        deep = x[ring[5][k]]
        x[ring[5][k]] = [min(deep[0], crest[0] - 1.6), max(deep[1], crest[1] + 1.5), deep[2]]
    x[layout.patches["ear_l"][1:-1, 1]] -= 2.8 * out
