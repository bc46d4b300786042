# SPDX-License-Identifier: GPL-3.0-or-later
"""Which ears a scan shows: hair hides them, and what lies in their place then is no ear."""

import numpy as np
from scipy.spatial import cKDTree

from ..anatomy.head import Head
from ..mesh import vertex_normals
from .closest import Surface
from .skin_groups import group

EAR_MARKS = ("sa", "sba", "pra", "pa", "obs", "obi", "t")
SOME_MARKS = 3  # of an ear's own landmarks: with so many it is taken as seen
AROUND_EAR = 9.0  # mm
BESIDE_EAR = 6.0  # mm from an ear in its place to data that shows it
THICK, AWAY = 10.0, -0.3  # mm from the front of an ear to its back; cosine between their normals
SHOWN = 0.7  # share of an ear with such data from which on it counts as seen


def seen_ears(reference: Head, given, skin: np.ndarray, target: Surface) -> dict[str, bool]:
    """Side -> whether that ear is in the scan: some of its own landmarks are ``given``, or one, and most of the ear as
    warped there (``skin`` (n, 3) mm) has data facing the same way beside it. Under hair only some can be placed."""
    out = {}
    for side in ("l", "r"):
        marks = sum(f"{m}_{side}" in given for m in EAR_MARKS)
        out[side] = marks >= SOME_MARKS
        ear = np.flatnonzero(group(reference, f"ear_{side}") > 0.5)
        if 1 <= marks < SOME_MARKS and len(ear):
            normal = vertex_normals(skin, reference.skin.triangles)
            found = target.ranked(skin[ear], normal[ear], BESIDE_EAR, 0.5)
            out[side] = bool((found.found & ~found.border).mean() > SHOWN)
    return out


def unseen_ears(reference: Head, given, skin, target: Surface) -> np.ndarray:
    """(n,) bool: ears that are not in the scan, and the skin close around them if there is no landmark at all: hair
    lies there."""
    out = np.zeros(len(reference.skin.vertices), dtype=bool)
    for side, seen in seen_ears(reference, given, skin, target).items():
        ear = group(reference, f"ear_{side}") > 0.3
        if not seen and ear.any():
            around = 0.0 if any(f"{m}_{side}" in given for m in EAR_MARKS) else AROUND_EAR
            out |= cKDTree(reference.skin.vertices[ear]).query(reference.skin.vertices)[0] <= around
    return out


def ear_sheets(reference: Head) -> np.ndarray:
    """(k, 2) vertices of the front of ears and of their back behind it. Scans show the one and seldom the other; without a
    tie between them, the front is fitted through the back."""
    v = reference.skin.vertices
    normal = vertex_normals(v, reference.skin.triangles)
    out = []
    for side in ("l", "r"):
        ear = np.flatnonzero(group(reference, f"ear_{side}") > 0.3)
        through = v[ear][None] - v[ear][:, None]
        far = np.linalg.norm(through, axis=2)
        deep = -np.einsum("ijk,ik->ij", through, normal[ear])
        facing = normal[ear] @ normal[ear].T
        far[(deep < 0.7 * far) | (facing > AWAY)] = np.inf
        near = far.argmin(axis=1)
        found = far.min(axis=1) < THICK
        out.append(np.stack([ear[found], ear[near[found]]], axis=1))
    return np.unique(np.sort(np.concatenate(out), axis=1), axis=0)
