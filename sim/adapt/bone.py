# SPDX-License-Identifier: GPL-3.0-or-later
"""Bone under fitted skin: moved by tissue-depth vectors (Kähler et al. 2002, section 5.2, item 2), and how deep it lies."""

import numpy as np

from ..anatomy.inside import inside
from ..anatomy.tissue_depth import skull_targets
from .closest import Surface
from .thin_plate_spline import ThinPlateSpline

#: mm of tissue that always remain over bone: at the very least, where the reference has little, where it has more.
LEAST, THIN, THICK = 1.12, 1.25, 2.0
LINING = 1.12  # mm, toward what lines mouth, lids and nostrils
NEAR = 12.0  # mm: bone deeper than this needs no test


def depth_under(points, skin: Surface, reach: float = np.inf):
    """How deep ``points`` (k, 3) lie under the skin, mm, negative outside; and the `Contacts` found.

    Points out of reach are as deep as ``reach``. Where the normal at the closest point is plain about the side it
    decides, else the winding number; the closed cups behind lips and lids count as outside.
    """
    found = skin.closest(points, reach)
    depth = np.where(found.found, found.distance, reach)
    near = np.flatnonzero(found.found)
    rise = np.einsum("ij,ij->i", points[near] - found.points[near], found.normals[near])
    out = rise > 0
    unsure = np.flatnonzero(np.abs(rise) < 0.7 * found.distance[near])
    out[unsure] = ~inside(points[near[unsure]], skin.vertices, skin.triangles)
    depth[near[out]] *= -1
    return depth, found


def follow_skin(vertices, skull_marks, landmarks, vectors, smoothing: float = 2.0):
    """The warp from the bone's current landmarks to those the tissue vectors ask for (5.2, item 2).

    vertices (n, 3) mm; skull_marks, landmarks, vectors : names -> (3,) mm, the bone's landmarks as they are, the
    fitted skin's, and the vectors from bone to skin. Returns (n, 3) mm.
    """
    wanted = skull_targets(landmarks, vectors)
    names = [n for n in wanted if n in skull_marks]
    if len(names) < 4:
        return np.array(vertices)
    source = np.array([skull_marks[n] for n in names])
    target = np.array([wanted[n] for n in names])
    return ThinPlateSpline.fit(source, target, smoothing).transform(vertices)


def least_depth(reference_depth) -> np.ndarray:
    """(k,) mm of tissue that must remain over bone vertices, given what the reference head has over them (k,)."""
    wanted = np.clip(0.5 * reference_depth, THIN, THICK)
    return np.maximum(np.minimum(wanted, 0.95 * reference_depth), LEAST)
