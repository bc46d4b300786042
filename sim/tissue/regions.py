# SPDX-License-Identifier: GPL-3.0-or-later
"""Regions of the face, for numbers that are told region by region."""

import numpy as np

from ..anatomy.head import Head

#: Region -> groups of the skin that it is made of. Where they overlap the one with the largest weight has the place.
GROUPS = {
    "forehead": ("forehead", "brow_l", "brow_r"),
    "lids": ("lid_upper_l", "lid_upper_r", "lid_lower_l", "lid_lower_r"),
    "nose": ("nose", "nostril_l", "nostril_r"),
    "cheeks": ("cheek_l", "cheek_r"),
    "lips": ("lip_upper", "lip_lower"),
    "chin": ("chin",),
    "neck": ("neck",),
}
#: Regions by number; the last is all that is in none: temples, ears, scalp, the lining of the mouth.
REGIONS = (*GROUPS, "elsewhere")
_LEAST = 0.2


def region_of(head: Head, triangles: np.ndarray) -> np.ndarray:
    """(t,) int, the number in `REGIONS` of each triangle (t, 3) of the skin."""
    none = np.zeros(len(head.skin.vertices))
    weight = np.array(
        [np.max([np.asarray(head.groups.get(g, none)) for g in names], axis=0) for names in GROUPS.values()]
    )
    mean = weight[:, triangles].mean(axis=2)
    return np.where(mean.max(axis=0) > _LEAST, mean.argmax(axis=0), len(GROUPS))
