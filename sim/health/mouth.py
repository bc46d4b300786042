# SPDX-License-Identifier: GPL-3.0-or-later
"""Teeth, gums and tongue lie in the hollow of the mouth bag, and teeth are rigid."""

import numpy as np
from scipy.spatial import cKDTree

from ..adapt.bone import depth_under
from ..adapt.closest import Surface
from ..adapt.thin_plate_spline import similarity
from ..anatomy.head import Head
from ..anatomy.inside import winding_number
from ..anatomy.teeth import crowns

IN_MOUTH = ("teeth_upper", "teeth_lower", "tongue")
#: Winding number of the skin one sees above which a place is in the head; closed lips let a little of it escape.
ENCLOSED = 0.4
NEAR_LIPS = 3.0  # mm
DIP = 0.6  # mm
FLESH = 12.0  # mm: no tooth lies deeper in it


def outside_bag(head: Head, part: str) -> int:
    """Vertices of crowns, gums or tongue that are not in the mouth's hollow: in the flesh, or in front of the lips.

    Gums rest in the lining, so they may dip into it by `DIP`.
    """
    mesh, skin = head.parts[part], head.skin
    crown = crowns(mesh)
    depth, found = depth_under(mesh.vertices, Surface(skin.vertices, skin.triangles), FLESH)
    tooth = np.zeros(len(crown), dtype=bool)
    if mesh.material is not None and part != "tongue":
        tooth[mesh.faces[mesh.material == 0].clip(min=0).ravel()] = True
    lost = crown & found.found & (depth > np.where(tooth, 0.0, DIP))
    # The only way out of the hollow, but through the flesh, leads between the lips.
    lips = np.maximum(head.groups["lip_upper"], head.groups["lip_lower"]) > 0.5
    near = np.flatnonzero(cKDTree(skin.vertices[lips]).query(mesh.vertices)[0] < NEAR_LIPS)
    seen = skin.triangles[head.groups["inner"][skin.triangles].max(axis=1) < 0.5]
    lost[near] |= winding_number(mesh.vertices[near], skin.vertices, seen) < ENCLOSED
    return int(lost.sum())


def rigidity(head: Head, reference: Head, part: str) -> float:
    """Largest distance, mm, of a part's vertices from the best similarity of the reference's: 0 for a rigid part."""
    source, target = reference.parts[part].vertices, head.parts[part].vertices
    matrix, shift = similarity(source, target)
    return float(np.linalg.norm(source @ matrix.T + shift - target, axis=1).max())
