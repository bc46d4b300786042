# SPDX-License-Identifier: GPL-3.0-or-later
"""Neck and bust: its posture and length, and what muscles, larynx and collar bones show under the skin."""

import numpy as np

from ...sim.adapt.closest import Surface
from ...sim.mesh import Mesh, vertex_normals
from .skin_bust import bust_columns
from .skin_fit import fair
from .skin_layout import Layout
from .skin_shape import both_sides

#: The heads that were measured stoop a little. How far the lower neck comes forward and goes down, and the throat goes
#: back, mm; how much broader the neck is, a share.
_FORWARD, _DOWN, _THROAT_BACK, _BROADER = 6.0, 12.0, 7.0, 0.05

#: The share of that way down that the shoulder does not go.
_SHOULDER_STAYS = 0.8

#: mm by which the bust goes on beyond what was measured: at the front, the shoulder and the back.
_BUST_LONGER = (10.0, 20.0, 14.0)

#: Line on the left side or the midline (x, y, z mm), how far the skin stands out along it, how broad that is (sigma).
#: The lines follow the bones they are named after and the muscle from mastoid to breastbone; all are put on the skin.
BRUSHES = (
    ("sternocleidomastoid", [(58, 14, -48), (52, 8, -80), (38, -2, -112), (25, 0, -138), (13, 2, -162)], 3.4, 8.0),
    ("its head on the collar bone", [(34, 6, -132), (30, 6, -150), (26, 4, -164)], 1.4, 6.0),
    ("between muscle and larynx", [(17, -22, -108), (15, -10, -124), (12, -3, -142)], -2.6, 6.5),
    ("behind the muscle, over the collar bone", [(52, 24, -118), (46, 18, -140), (44, 14, -156)], -3.2, 8.0),
    ("thyroid cartilage", [(0, -20, -115), (0, -16, -122)], 7.5, 7.5),
    ("cricoid cartilage and windpipe", [(0, -9, -134), (0, -3, -146)], 2.0, 7.0),
    ("suprasternal notch", [(0, 2, -156), (0, 2, -163)], -5.0, 7.5),
    ("collar bone", [(15, 1, -169), (34, 3, -169), (55, 14, -164), (71, 30, -152), (78, 42, -143)], 3.4, 6.0),
    ("under the collar bone", [(40, 3, -183), (62, 10, -178), (76, 22, -168)], -3.6, 7.0),
    ("breastbone", [(0, 0, -180), (0, -4, -192)], -1.2, 8.0),
)


def _ease(t):
    t = np.clip(t, 0, 1)
    return t * t * (3 - 2 * t)


def _upright(points: np.ndarray) -> np.ndarray:
    """(n, 3) mm: points of head and neck where they are when the neck stands more upright under the head."""
    x, y, z = points.T
    height = z - 0.286 * (y - 6)  # over a plane through collar bones and the seventh vertebra of the neck
    low = _ease((-98 - height) / 62)
    throat = np.exp(-(((z + 111) / 15) ** 2) / 2 - (x / 34) ** 2 / 2) * _ease((y + 56) / 24) * _ease((40 - y) / 60)
    wider = _BROADER * _ease((-72 - height) / 30) * _ease((z + 128) / 30)
    out = points.copy()
    out[:, 0] += wider * x
    out[:, 1] += _THROAT_BACK * throat - _FORWARD * low
    out[:, 2] -= _DOWN * low * (1 - _SHOULDER_STAYS * _ease((abs(x) - 38) / 45))
    return out


def _longer_bust(layout: Layout, x: np.ndarray) -> None:
    """The rows of the bust spread, evenly, over more of the shoulders (left side and midline)."""
    columns = bust_columns(layout)[:, 2:]
    more = np.interp(np.arange(len(columns)), [0, 8, 16], _BUST_LONGER)
    for column, extra in zip(columns, more, strict=True):
        path = x[column]
        ahead = path[-1] - path[-2]
        ahead[2] *= 0.6 if abs(ahead[0]) > 3 else 1.0
        path = np.concatenate([path, path[-1:] + extra * ahead / np.linalg.norm(ahead)])
        length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]
        at = np.linspace(0, length[-1], len(column))
        x[column] = np.stack([np.interp(at, length, path[:, k]) for k in range(3)], axis=1)


def _even_throat(layout: Layout, x: np.ndarray, length: float = 13.0) -> np.ndarray:
    """Where the rows under the jaw thin out toward the neck the surface is freed of their unevenness."""
    weight = np.zeros(layout.count)
    vertex, column, row = layout.places()
    weight[vertex] = np.interp(row, [25, 26, 27, 29, 31], [0, 0.25, 1, 0.8, 0]) * np.interp(
        abs(column), [11, 14], [1, 0.3]
    )
    return fair(layout, x, weight, length)


def _even_joint(layout: Layout, x: np.ndarray, length: float = 4.5) -> np.ndarray:
    """Where the columns of the neck thin out (rows 29 and 30) what the brushes left uneven is smoothed."""
    weight = np.zeros(layout.count)
    vertex, _, row = layout.places()
    weight[vertex] = np.interp(row, [28, 29, 31, 32], [0, 1, 1, 0])
    return np.where(weight[:, None] > 0, fair(layout, x, weight, length), x)


def _to_line(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """(n,) mm from points (n, 3) to a polyline (k, 3)."""
    if len(line) == 1:
        return np.linalg.norm(points - line[0], axis=1)
    start, step = line[:-1], np.diff(line, axis=0)
    along = ((points[:, None] - start) * step).sum(axis=2) / (step**2).sum(axis=1)
    foot = start + np.clip(along, 0, 1)[..., None] * step
    return np.linalg.norm(points[:, None] - foot, axis=2).min(axis=1)


def finish_neck(layout: Layout, x: np.ndarray) -> None:
    """Set the neck upright and the bust longer, then stroke the brushes over them, along the skin's normals (left side)."""
    x[:] = _upright(x)
    _longer_bust(layout, x)
    x[:] = whole = both_sides(_even_throat(layout, both_sides(x[layout.left]))[layout.left])
    triangles = Mesh(whole, layout.faces).triangles
    skin, normal = Surface(whole, triangles), vertex_normals(whole, triangles)
    out = np.zeros(layout.count)
    for _, line, height, sigma in BRUSHES:
        line = _upright(np.array(line, float))
        on_skin = skin.closest(line).points
        on_skin[line[:, 0] == 0, 0] = 0  # of two places as near on either side, rounding would choose
        out += height * np.exp(-((_to_line(whole, on_skin) / sigma) ** 2) / 2)
    inside = np.concatenate([rings.ravel() for rings in layout.rings.values()])
    out[inside] = 0
    out[layout.edge] = 0
    x += out[:, None] * normal
    x[:] = _even_joint(layout, both_sides(x[layout.left]))
