# SPDX-License-Identifier: GPL-3.0-or-later
"""Broad forms of the face that averaging flattens are raised again: brow, temple, cheekbone, folds, chin and jaw.

Each form is a line of a few points near the mean head's surface with a height in mm at each, spread over a width like
a Gaussian; the skin moves along its normals. Negative heights are hollows. Our own numbers, set by eye against surface
anatomy (Gray's Anatomy, 41st ed., chapter 30).
"""

from dataclasses import dataclass

import numpy as np

from ...sim.mesh import Mesh, vertex_normals
from .skin_fit import outer_skin
from .skin_layout import Layout


@dataclass(frozen=True)
class Form:
    """``line`` of (x, y, z, height) mm on the left side, spread over ``width`` mm."""

    name: str
    width: float
    line: tuple[tuple[float, float, float, float], ...]


FORMS = (
    # brow: the arch over the orbit's inner half, the orbit's rim outward, the hollow of the temple behind
    Form("superciliary arch", 5.5, ((5, -101, 33, 0.3), (14, -100, 37, 0.7), (26, -97, 40, 0.5), (38, -93, 41, 0.1))),
    Form("orbital rim", 5.0, ((40, -90, 36, 0.2), (49, -83, 31, 0.7), (55, -75, 24, 0.5))),
    Form("temporal line", 5.0, ((54, -77, 38, 0.4), (58, -68, 52, 0.7), (60, -55, 68, 0.4))),
    Form("temple", 15.0, ((66, -55, 36, -2.0), (71, -38, 38, -2.0))),
    # cheek: bone, the hollow under it, the fold from the nose's wing and the cheek's mound beside it
    Form("zygomatic", 8.0, ((40, -80, -8, 0.6), (53, -68, -5, 1.8), (62, -52, -2, 1.7), (68, -34, 2, 0.8))),
    Form("cheek hollow", 11.0, ((53, -62, -30, -1.4), (60, -42, -34, -1.8))),
    Form("nasolabial fold", 3.5, ((20, -88, -24, -0.7), (26, -85, -36, -1.1), (33, -80, -47, -0.8), (37, -75, -56, 0))),
    Form("malar mound", 8.0, ((28, -84, -20, 0.8), (36, -79, -32, 0.9), (43, -72, -44, 0.4))),
    # chin and jaw
    Form("mental protuberance", 8.0, ((0, -88, -85, 0.8), (10, -84, -90, 0.7))),
    Form("mentolabial fold", 4.5, ((0, -85, -72, -0.7), (14, -82, -73, -0.5), (22, -77, -76, 0))),
    Form("jaw line", 6.0, ((24, -70, -90, 0.3), (42, -45, -76, 0.7), (54, -22, -64, 0.5), (58, -10, -55, 0.3))),
    Form("under the jaw", 8.0, ((20, -52, -100, -0.8), (38, -28, -92, -1.0), (50, -6, -80, -0.7))),
)  # fmt: skip


def _share(points: np.ndarray, form: Form) -> np.ndarray:
    """(n,) mm by which a form raises each of (n, 3) points: height of the line's nearest place times a Gaussian."""
    line = np.array(form.line, float)
    start, end = line[:-1], line[1:]
    along = (end - start)[:, :3]
    t = ((points[:, None] - start[:, :3]) * along).sum(axis=2) / (along**2).sum(axis=1)
    t = np.clip(t, 0, 1)[..., None]
    foot = start + t * (end - start)
    squared = ((points[:, None] - foot[..., :3]) ** 2).sum(axis=2)
    near = squared.argmin(axis=1)
    rows = np.arange(len(points))
    return foot[rows, near, 3] * np.exp(-squared[rows, near] / (2 * form.width**2))


def raise_forms(layout: Layout, x: np.ndarray) -> None:
    """`FORMS` on the left side and the midline of (n, 3) mm, in place."""
    normal = vertex_normals(x, Mesh(x, layout.faces).triangles)
    outer = outer_skin(layout)
    outer[layout.grid[layout.grid >= 0]] = True
    height = np.zeros(len(x))
    for form in FORMS:
        height += _share(x, form)
    x += (height * outer)[:, None] * normal
