# SPDX-License-Identifier: GPL-3.0-or-later
"""The lining of the mouth as the mucosa runs: deep between lips and gums, over the ridges, to palate and floor."""

import numpy as np

from ...sim.mesh_subdivision import limit
from .skin_layout import Layout

#: Where the limit surface lies, (x, behind, above) mm against the middle of the line where the lips meet; from the
#: middle sideways, the first eight over the mouth, then the corner's meridian, then eight under it. The second ring
#: runs over the ridges 2.5 mm beyond the teeth's necks, outside of arches 60 mm wide at the molars.
_UPPER = {
    8: [(0, 6.8, 12.5), (6, 7.3, 12.6), (12.5, 9.6, 12.9), (18.8, 13.9, 13.2), (24.2, 19.6, 12.8), (28.4, 27.5, 11.6),
        (30.5, 35, 9), (33, 39, 4)],
    9: [(0, 13, 11.2), (6.5, 14, 11.2), (11.5, 17, 11.4), (16.5, 22, 12), (20.5, 30, 12.8), (24, 40, 13.3),
        (29.5, 51, 14.8), (34, 56, 8.5)],
    10: [(0, 32, 15), (5, 33, 15), (9.5, 36, 14.8), (13, 40, 14.6), (16.5, 46, 14.4), (20.5, 52.5, 14.6), (26, 60, 13.2),
         (29.8, 62.5, 7)],
}  # fmt: skip
_CORNER = {8: (33.5, 38, -2.8), 9: (34.5, 56, 0.5), 10: (30, 62.5, 0.5)}
_LOWER = {
    8: [(0, 9.8, -13.2), (6, 10.5, -13.4), (12, 13.8, -13.6), (18, 19, -13.2), (23.5, 26, -12), (27.5, 32, -10.8),
        (31, 37, -9), (33, 39.5, -6)],
    9: [(0, 15.5, -10.8), (6.5, 16.5, -11), (12, 19.5, -11.8), (17, 24, -10), (21, 33, -8.3), (24.5, 43, -6.7),
        (29, 52, -5.2), (33.5, 56, -3.3)],
    10: [(0, 32, -15.6), (5, 33, -15.6), (9.5, 36, -15.6), (13, 41, -15.4), (16, 46.5, -14.8), (19.5, 52, -13.5),
         (25, 59, -9), (29.5, 62, -4.5)],
}  # fmt: skip

#: mm behind the line: the middle of the back wall.
_BACK = 67.0


def mouth_bag(layout: Layout, x: np.ndarray) -> None:
    """Rings 8 to 10 of the mouth and the patch that closes it, behind lips already finished."""
    ring, patch = layout.rings["mouth"], layout.patches["mouth"]
    line = 0.5 * (x[ring[6][27]] + x[ring[6][11]])
    targets = []
    for k, upper in _UPPER.items():
        around = np.empty((32, 3))
        for step, (above, below) in enumerate(zip(upper, _LOWER[k], strict=True)):
            around[27 - step], around[11 + step] = above, below
            around[(27 + step) % 32], around[11 - step] = above * _FLIP, below * _FLIP
        around[19], around[3] = _CORNER[k], _CORNER[k] * _FLIP
        targets.append((ring[k], line + around))
    back = 0.5 * (targets[-1][1][(np.arange(21, 34) % 32)[::-1]] + targets[-1][1][np.arange(5, 18)])
    back[:, 1:] = line[1:] + np.stack([_BACK - 1.5 * (back[:, 0] / 26) ** 2, np.zeros(13)], axis=1)
    targets.append((patch[1, 1:-1], back))
    for vertices, place in targets:
        x[vertices] = place
    smooth = limit(layout.faces, layout.count)
    for _ in range(4):
        now = smooth @ x
        for vertices, place in targets:
            x[vertices] += 0.8 * (place - now[vertices])


_FLIP = np.array([-1.0, 1.0, 1.0])
