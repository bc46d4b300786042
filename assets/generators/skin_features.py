# SPDX-License-Identifier: GPL-3.0-or-later
"""The feature mesh: a symmetric triangulation of the skin landmarks (Kähler 2002, section 6.2 and figure 4)."""

import numpy as np
from scipy.spatial import ConvexHull

from ...sim.anatomy.landmark_names import SKIN, mirrored

#: Seen from here no two landmarks hide each other, so triangles between neighbours in direction never fold (mm).
CENTRE = (0.0, -20.0, 0.0)


def feature_mesh(positions: dict[str, np.ndarray]) -> np.ndarray:
    """(f, 3) int32 triangles over `landmark_names.SKIN`, counter-clockwise seen from outside, symmetric left to right.

    Neighbours are those of the spherical Delaunay triangulation about `CENTRE` (a convex hull of directions). What
    would close the neck from below is left out.
    """
    points = np.array([positions[name] for name in SKIN]) - CENTRE
    unit = points / np.linalg.norm(points, axis=1, keepdims=True)
    partner = np.array([SKIN.index(mirrored(name)) for name in SKIN])
    side = np.array([{"_l": 1, "_r": -1}.get(name[-2:], 0) for name in SKIN])
    hull = ConvexHull(unit)
    triangles = hull.simplices.astype(np.int32)
    a, b, c = (unit[triangles[:, k]] for k in range(3))
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c)
    triangles[outward < 0] = triangles[outward < 0][:, ::-1]
    one_side = triangles[(side[triangles] >= 0).all(axis=1) & (side[triangles] > 0).any(axis=1)]
    neck = {SKIN.index("gn"), SKIN.index("op")}
    one_side = one_side[[not neck <= set(t) for t in one_side.tolist()]]
    return np.concatenate([one_side, partner[one_side][:, ::-1]]).astype(np.int32)
