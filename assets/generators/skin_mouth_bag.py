# SPDX-License-Identifier: GPL-3.0-or-later
"""The lining of the mouth as the mucosa runs: a slit between lips and gums, over the alveolar ridges, to palate and floor.

Ring 8 is the fornix of the vestibule, 9 and 10 are the outer and the inner line of the teeth's necks, so that between
them the lining rides over the ridge; 11 lies on the palate and on the floor. Behind the last molars the ridges of both
jaws meet in the fold between them (raphe).
"""

import numpy as np

from ...sim.mesh_subdivision import limit
from .skin_layout import Layout
from .skin_lips import lip_places
from .teeth_places import neck_line, tooth_rows

#: Where the limit surface lies, (x, behind, above) mm against the middle of the line where the lips meet; from the
#: middle sideways, eight over the mouth, then the corner's meridian, then eight under it.
_UPPER = {
    8: [(0, 6.0, 13.4), (5, 6.3, 13.5), (10, 7.5, 13.9), (15.8, 10.5, 14.4), (22, 15.5, 14.6), (27.8, 22.8, 14.2),
        (31.3, 32, 12), (33.4, 40.5, 6.5)],
    11: [(0, 30, 17.6), (4.5, 31, 17.6), (8.0, 34, 17.6), (11, 38, 17.7), (13.4, 43, 17.8), (15.2, 49.5, 17.8), (17, 57, 16),
         (19.5, 66, 10)],
}  # fmt: skip
_CORNER = {8: (33.8, 42.5, -0.5), 9: (32.5, 64.5, 3), 10: (28.5, 70, 3), 11: (24, 71.5, 2)}
_LOWER = {
    8: [(0, 9.4, -14.2), (5, 9.7, -14.4), (10, 11.0, -14.6), (15.6, 14.0, -14.2), (21.6, 19.0, -13), (26.8, 25.4, -11.6),
        (31.5, 33, -9.8), (34, 40, -6)],
    11: [(0, 31, -17), (4.5, 32, -17), (8.5, 35, -17), (11.5, 40, -16.6), (13.6, 45.5, -16), (15.2, 52, -14.5),
         (17, 59, -12), (19, 67, -6)],
}  # fmt: skip

#: Way along the necks from the midline to the points of rings 9 and 10, as a share of that to the last molar, and the
#: last point's way behind that molar's neck, mm.
_ALONG, _PAST = (0.0, 0.095, 0.19, 0.295, 0.42, 0.575, 0.78), (4.0, 3.7)

#: mm by which the lining stands off the teeth's necks: outward and inward; and toward the roots, above and below.
_STAND, _APICAL = (
    0.9,
    (np.array([1.9, 1.7, 1.7, 1.5, 1.2, 1.0, 0.8, 2.8]), np.array([1.3, 1.3, 2.2, 1.8, 1.3, 1.3, 1.3, 1.0])),
)

#: The same toward the roots more on the inner side, and outward more beside the last molar above.
_INNER, _LAST = 0.5, 0.3

#: How much the cage keeps to the places wanted of the limit surface, by steps from the middle to the corner: free of
#: this it would swing and cut itself.
_STIFF = np.array([0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.5, 2.0, 2.0])

#: The same on palate and floor: bone, which keeps clear of the cage too, is to be near them.
_BROAD = 2.0

#: mm behind the line: the middle of the back wall.
_BACK = 72.5

_FLIP = np.array([-1.0, 1.0, 1.0])


def mouth_bag(layout: Layout, x: np.ndarray) -> None:
    """Rings 8 to 11 of the mouth and the patch that closes it, behind lips already finished."""
    ring, patch = layout.rings["mouth"], layout.patches["mouth"]
    line = 0.5 * (x[ring[6][27]] + x[ring[6][11]])
    rows = tooth_rows(x[ring[6][27]])
    necks = [_necks(rows[name], _PAST[k], _APICAL[k], line) for k, name in enumerate(("upper", "lower"))]
    upper, lower = ({**fixed, 9: near[0], 10: near[1]} for fixed, near in zip((_UPPER, _LOWER), necks, strict=True))
    places, wanted = [], []
    for k in (8, 9, 10, 11):
        around = np.empty((32, 3))
        for step, (above, below) in enumerate(zip(upper[k], lower[k], strict=True)):
            around[27 - step], around[11 + step] = above, below
            around[(27 + step) % 32], around[11 - step] = above * _FLIP, below * _FLIP
        around[19], around[3] = _CORNER[k], _CORNER[k] * _FLIP
        places.append(ring[k])
        wanted.append(line + around)
    back = 0.5 * (wanted[-1][(np.arange(21, 34) % 32)[::-1]] + wanted[-1][np.arange(5, 18)])
    back[:, 1:] = line[1:] + np.stack([_BACK - 1.5 * (back[:, 0] / 26) ** 2, np.zeros(13)], axis=1)
    rows, target = np.concatenate([*places, patch[1, 1:-1]]), np.concatenate([*wanted, back])
    x[rows] = target
    smooth = limit(layout.faces, layout.count)[rows]
    inner = smooth[:, rows].toarray()
    ridge = _STIFF[8 - lip_places()[1]]
    stiff = np.concatenate([ridge, ridge, ridge, np.full(32, _BROAD), np.full(13, _STIFF[0])])
    x[rows] += np.linalg.solve(inner.T @ inner + np.diag(stiff), inner.T @ (target - smooth @ x))


def _necks(places, past, apical, line):
    """(2, 8, 3) mm against the line: points outside and inside of the necks of a row's left half."""
    out = []
    for way, down in ((1, apical), (-1, apical + _INNER)):
        points = neck_line(places, np.array(_ALONG), past, way, _STAND, down[:, None])
        points[0, 0] = 0.0
        if way > 0 and places[0].axis[2] > 0:
            points[-1, 0] += _LAST
        out.append(points - line)
    return np.array(out)
