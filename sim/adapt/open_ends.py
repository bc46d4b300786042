# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the data of a scan ends: not at every open side.

Scanners leave out single triangles, and patches that they put beside each other do not join. Skin is seen on either side of
such a gap, and what is nearest to a point over it is within the width of a triangle from the truth.
"""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

ACROSS = 1.3  # sides of the triangles around, outward: the surface goes on there behind a gap
CLOSE = 0.5  # sides: how near it must be
WIDEST = 4.0  # mm: sides that are longer count as that long; what a coarse mesh lacks is missed
ROUNDS = 4  # of asking the neighbours along open sides, most of whom are right
WHOLE = 0.6  # share of an outline that ends data from which on all of it does, its notches too


def data_ends(vertices, triangles, sides, nearest) -> np.ndarray:
    """(n,) bool: the vertices before which there is nothing, of those on open ``sides``.

    vertices (n, 3) mm, triangles (m, 3); sides (k, 2) vertices; nearest : points (k, 3) -> distance (k,) to the surface, mm
    """
    n = len(vertices)
    out = np.zeros(n, dtype=bool)
    if len(sides) == 0:
        return out
    rim, ends = np.unique(sides, return_inverse=True)
    out[rim] = True
    way, side = outward(vertices, triangles[out[triangles].any(axis=1)], rim)
    side = np.minimum(side, WIDEST)
    ended = nearest(vertices[rim] + (ACROSS * side)[:, None] * way) > CLOSE * side
    a, b = ends.reshape(sides.shape).T
    k = np.arange(len(rim))
    link = coo_matrix((np.ones(2 * len(a) + len(k)), (np.r_[a, b, k], np.r_[b, a, k])), shape=(len(k), len(k))).tocsr()
    asked = link @ np.ones(len(k))
    for _ in range(ROUNDS):
        ended = link @ ended >= 0.5 * asked
    _, outline = connected_components(link, directed=False)
    whole = np.bincount(outline, ended) >= WHOLE * np.bincount(outline)
    out[rim] = ended | whole[outline]
    return out


def outward(vertices, around, rim):
    """(k, 3) unit vectors along the surface and away from it at the vertices ``rim`` (k,), of which ``around`` (t, 3) are the
    triangles; and (k,) mm, how long their sides are."""
    a, b, c = vertices[around].transpose(1, 0, 2)
    cross, middle = np.cross(b - a, c - a), (a + b + c) / 3
    corner, n = around.ravel(order="F"), len(vertices)
    offset = np.concatenate([a - middle, b - middle, c - middle])
    normal, way = (
        np.stack([np.bincount(corner, each[:, k], n)[rim] for k in range(3)], axis=1)
        for each in (np.tile(cross, (3, 1)), offset)
    )
    count = np.bincount(corner, minlength=n)[rim]
    side = np.sqrt(3) * np.bincount(corner, np.linalg.norm(offset, axis=1), n)[rim] / count
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    way -= normal * np.einsum("ij,ij->i", way, normal)[:, None]
    return way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12), side
