# SPDX-License-Identifier: GPL-3.0-or-later
"""Teeth, gums and tongue lie in the hollow of the mouth bag, and teeth are rigid."""

import numpy as np
from scipy.spatial import cKDTree

from ..adapt.thin_plate_spline import similarity
from ..anatomy.head import Head
from ..anatomy.inside import winding_number
from .enclosure import enclosed

IN_MOUTH = ("teeth_upper", "teeth_lower", "tongue")
#: Winding number of the skin one sees above which a place is in the head; closed lips let a little of it escape.
ENCLOSED = 0.4
NEAR_LIPS = 3.0  # mm


def outside_bag(head: Head, part: str) -> int:
    """Vertices of a part that are not in the mouth's hollow: in the flesh, or in front of the lips."""
    mesh, skin = head.parts[part], head.skin
    lost = enclosed(mesh, skin)
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
