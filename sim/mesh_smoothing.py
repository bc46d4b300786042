# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a surface pierces itself a little it is smoothed until it does not."""

import numpy as np
from scipy.sparse import coo_matrix

from .mesh import edges
from .mesh_piercing import self_piercings

STEP = 0.2  # of the way to the middle of the neighbours, in a round
FAR = 1.4  # mm that a vertex may move in all


def smoothed_free(vertices, triangles, rounds: int = 40):
    """Vertices (n, 3) mm of the mesh with ``triangles`` (m, 3), smoothed around those that pierce others.

    What so little does not free is returned with the fewest piercings found.
    """
    start = np.asarray(vertices, dtype=float)
    out, n = start, len(start)
    a, b = edges(triangles).T
    link = coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(n, n)).tocsr()
    count = np.maximum(np.asarray(link.sum(axis=1)), 1)
    among, best, fewest = None, start, None
    share = np.zeros(n)
    for _ in range(rounds):
        pairs = self_piercings(out, triangles, among)
        if fewest is None or len(pairs) < fewest:
            best, fewest = out, len(pairs)
        if len(pairs) == 0:
            break
        wrong = np.zeros(n)
        wrong[triangles[pairs.ravel()].ravel()] = 1.0
        beside = (link @ wrong > 0).astype(float)
        share = np.maximum.reduce([wrong, 0.6 * beside, 0.25 * (link @ beside > 0)])
        off = out + STEP * share[:, None] * (np.asarray(link @ out) / count - out) - start
        far = np.linalg.norm(off, axis=1, keepdims=True)
        out = start + off * np.minimum(1, FAR / np.maximum(far, 1e-12))
        touched = (share > 0)[triangles].any(axis=1)
        among = touched if among is None else among | touched
    return best
