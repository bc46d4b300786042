# SPDX-License-Identifier: GPL-3.0-or-later
"""The linings of the nostrils lie within the bony aperture of the nose.

Where a scan shows nostrils as deep as no skull has room for, or wider, lining and bone would run through each other, and
bone that had to give way to both walls of such a pocket would break. Mucosa is what is soft: the passage narrows toward its
middle, and where that itself leads into bone, it ends before. Only what is still lacking is left to the bone
(`bone_inside`).
"""

import numpy as np
from scipy.sparse import csr_matrix

from ..mesh import Mesh
from .closest import Surface
from .rest import Rest
from .skin_cover import signed_depth

PARTS = 4  # of the side of a triangle, between places that are looked at
PLACES = 20  # on the way from ring to ring of a passage
AROUND = 8.0  # mm round a nostril within which bone is looked for
STEP, MOST = 0.1, 0.9  # share of the way to the middle of the passage, at a time and at most
DEEP = 0.8  # mm: where a lining lies no deeper in bone than this, the bone gives way
FREE = 1.2  # mm that the middle of a passage keeps from bone


def within_bone(rest: Rest, skin: np.ndarray, skull: Mesh) -> np.ndarray:
    """(n, 3) mm: ``skin`` (n, 3) mm with the linings of its nostrils out of the ``skull``, but for `DEEP`, as far as they can
    be narrowed."""
    out = np.array(skin, dtype=float)
    for rows in rest.nostrils:
        out[rows] = _narrowed(rest, rows, out, skull)
    return out


def _narrowed(rest: Rest, rows, skin, skull: Mesh):
    """(k, 3) mm, for the lining ``rows`` (k,) of one nostril."""
    low, high = skin[rows].min(axis=0) - AROUND, skin[rows].max(axis=0) + AROUND
    inside = ((skull.vertices > low) & (skull.vertices < high)).all(axis=1)
    bone = skull.triangles[inside[skull.triangles].any(axis=1)]
    if len(bone) == 0:
        return skin[rows]
    surface, places = Surface(skull.vertices, bone), _places(rest.head.skin.triangles, rows, len(skin))
    behind, start, now = rest.behind[rows], skin[rows], np.array(skin)
    steps, ring = np.unique(behind, return_inverse=True)
    middle = np.array([start[behind == step].mean(axis=0) for step in steps])
    way = middle[0] + np.linspace(1, 0, PLACES)[:, None, None] * (middle - middle[0])
    free = signed_depth(way.reshape(-1, 3), surface, AROUND, skull)[0].reshape(way.shape[:2]) < -FREE
    ends = np.where(free.any(axis=0), free.argmax(axis=0), PLACES - 1)
    middle = way[ends, np.arange(len(steps))][ring]
    touched = abs(places[:, rows]).T
    share = np.zeros(len(rows))
    while True:
        points = places @ now
        deep = signed_depth(points, surface, AROUND, skull)[0] > DEEP
        more = (touched @ deep.astype(float) > 0) & (share < MOST - STEP / 2)
        if not more.any():
            return now[rows]
        share[more] += STEP
        now[rows] = start + share[:, None] * (middle - start)


def _places(triangles, rows, n) -> csr_matrix:
    """(p, n) sparse rows that give places all over the ``triangles`` (t, 3) between the vertices ``rows``, and beside them,
    from the n vertices of the skin."""
    of = triangles[np.isin(triangles, rows).sum(axis=1) > 1]
    weights = np.array([(i, j, PARTS - i - j) for i in range(PARTS + 1) for j in range(PARTS + 1 - i)]) / PARTS
    index = (np.repeat(np.arange(len(of) * len(weights)), 3), np.repeat(of, len(weights), axis=0).ravel())
    return csr_matrix((np.tile(weights, (len(of), 1)).ravel(), index), shape=(len(of) * len(weights), n))
