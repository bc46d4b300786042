# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the lining of the mouth is grown onto the gums, the palate and the floor of the mouth, and goes where they go.

Gingiva and the mucosa of the palate are bound to the bone under them (masticatory mucosa); only the lining of lips and
cheeks slides.
"""

import numpy as np
from scipy.spatial import cKDTree

from ..anatomy.head import Head

#: Restoration of what is grown onto bone, in multiples of that of skin over 8 mm of tissue.
ATTACHED = 300.0
#: mm from the gum within which the lining is part of it, and from which on it is not.
NEAR, FAR = 2.0, 5.5


def attached(head: Head) -> tuple[np.ndarray, np.ndarray]:
    """(n,) 0..1, how far each vertex of the skin is grown onto a gum; (n,) 1 where that is the lower one, else 0.

    All of the lining that lies on the inner side of a row of teeth is.
    """
    n = len(head.skin.vertices)
    hold, below = np.zeros(n), np.zeros(n)
    bag = np.flatnonzero(np.asarray(head.groups.get("mouth_bag", np.zeros(n))) > 0.9)
    rows = [head.parts.get(part) for part in ("teeth_upper", "teeth_lower")]
    if not len(bag) or any(row is None or row.material is None for row in rows):
        return hold, below
    at = head.skin.vertices[bag]
    away = []
    for row in rows:
        gum = row.faces[row.material == 1]
        tree = cKDTree(row.vertices[np.unique(gum[gum >= 0])])
        distance, near = tree.query(at)
        # behind the gum: nearer to the middle of the arch than what is nearest of it
        middle = np.array([row.vertices[:, 0].mean(), row.vertices[:, 1].max()])
        inside = (
            np.linalg.norm(at[:, :2] - middle, axis=1) < np.linalg.norm(tree.data[near][:, :2] - middle, axis=1) - 1
        )
        away.append(np.where(inside & (distance < 12), np.minimum(distance, NEAR), distance))
    away = np.array(away)
    hold[bag] = np.clip((FAR - away.min(axis=0)) / (FAR - NEAR), 0, 1)
    below[bag] = away.argmin(axis=0)
    return hold, below
