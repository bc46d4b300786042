# SPDX-License-Identifier: GPL-3.0-or-later
"""Neck and bust: what muscles, larynx and collar bones show under the skin."""

import numpy as np

from ...sim.adapt.closest import Surface
from ...sim.mesh import Mesh, vertex_normals
from .skin_layout import Layout
from .skin_shape import both_sides

#: Line on the left side or the midline (x, y, z mm), how far the skin stands out along it, how broad that is (sigma).
#: The lines follow the bones they are named after and the muscle from mastoid to breastbone; all are put on the skin.
BRUSHES = (
    ("sternocleidomastoid", [(58, 14, -48), (52, 8, -80), (38, -2, -112), (25, 0, -138), (13, 2, -162)], 3.4, 8.0),
    ("its head on the collar bone", [(34, 6, -132), (30, 6, -150), (26, 4, -164)], 1.4, 6.0),
    ("between muscle and larynx", [(17, -22, -108), (15, -10, -124), (12, -3, -142)], -3.4, 6.0),
    ("behind the muscle, over the collar bone", [(52, 24, -118), (46, 18, -140), (44, 14, -156)], -3.2, 8.0),
    ("thyroid cartilage", [(0, -20, -115), (0, -16, -122)], 7.5, 7.5),
    ("cricoid cartilage and windpipe", [(0, -9, -134), (0, -3, -146)], 2.0, 7.0),
    ("suprasternal notch", [(0, 2, -156), (0, 2, -163)], -5.0, 7.5),
    ("collar bone", [(15, 1, -169), (34, 3, -169), (55, 14, -164), (71, 30, -152), (78, 42, -143)], 3.4, 6.0),
    ("under the collar bone", [(40, 3, -183), (62, 10, -178), (76, 22, -168)], -2.0, 7.0),
    ("breastbone", [(0, 0, -180), (0, -4, -192)], -1.2, 8.0),
)


def _to_line(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """(n,) mm from points (n, 3) to a polyline (k, 3)."""
    if len(line) == 1:
        return np.linalg.norm(points - line[0], axis=1)
    start, step = line[:-1], np.diff(line, axis=0)
    along = ((points[:, None] - start) * step).sum(axis=2) / (step**2).sum(axis=1)
    foot = start + np.clip(along, 0, 1)[..., None] * step
    return np.linalg.norm(points[:, None] - foot, axis=2).min(axis=1)


def finish_neck(layout: Layout, x: np.ndarray) -> None:
    """Stroke the brushes over the neck, along the skin's normals; the open edge stays (left side)."""
    whole = both_sides(x[layout.left])
    triangles = Mesh(whole, layout.faces).triangles
    skin, normal = Surface(whole, triangles), vertex_normals(whole, triangles)
    out = np.zeros(layout.count)
    for _, line, height, sigma in BRUSHES:
        on_skin = skin.closest(np.array(line, float)).points
        out += height * np.exp(-((_to_line(whole, on_skin) / sigma) ** 2) / 2)
    inside = np.concatenate([rings.ravel() for rings in layout.rings.values()])
    out[inside] = 0
    out[layout.edge] = 0
    x += out[:, None] * normal
