# SPDX-License-Identifier: GPL-3.0-or-later
"""Which side of a cloud of points is out.

After Hoppe, DeRose, Duchamp, McDonald and Stuetzle 1992, "Surface reconstruction from unorganized points", section 3.3: sides
are passed on along the spanning tree of those neighbours whose planes are most alike.
"""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

#: What keeps the weight of neighbours in one plane from being none, which is no neighbour to a sparse matrix.
LEAST = 1e-4
#: A piece of less than this part of the points is a patch of the whole: it bulges from the middle of that, not from its own.
PART = 0.05


def outward(points: np.ndarray, normals: np.ndarray, near: np.ndarray) -> np.ndarray:
    """(n, 3): ``normals`` (n, 3) of ``points`` (n, 3) turned so that those of ``near`` (n, k), the nearest of each, agree, and
    of each piece that hangs together so that it bulges out.

    Neighbours count as alike whose planes are, and which lie beside each other in them: the two sides of an ear are alike too,
    but lie over each other.
    """
    tree = _alike(points, normals, near)
    count, piece = connected_components(tree, directed=False)
    turned = normals * _passed_on(tree, np.unique(piece, return_index=True)[1], normals)[:, None]
    share = np.bincount(piece, minlength=count)
    middle = np.stack([np.bincount(piece, column, minlength=count) / share for column in points.T], axis=1)
    middle[share < PART * len(points)] = points.mean(axis=0)
    bulge = np.einsum("ij,ij->i", turned, points - middle[piece])
    inward = np.bincount(piece, bulge, minlength=count) < 0
    return np.where(inward[piece, None], -turned, turned)


def _alike(points, normals, near):
    """The spanning trees of the points, linked to those of their nearest that are most alike."""
    n, k = near.shape
    one, other = np.repeat(np.arange(n), k - 1), near[:, 1:].ravel()
    apart = points[other] - points[one]
    length = np.linalg.norm(apart, axis=1)
    apart /= np.where(length > 0, length, 1)[:, None]
    unlike = 1 - np.abs(np.einsum("ij,ij->i", normals[one], normals[other]))
    for end in (one, other):
        unlike += np.abs(np.einsum("ij,ij->i", apart, normals[end])) / 2
    return minimum_spanning_tree(coo_matrix((LEAST + unlike, (one, other)), shape=(n, n)).tocsr())


def _passed_on(tree, roots, normals):
    """(n,) 1 or -1: what makes normals agree with those that they are linked to in ``tree``, from its ``roots`` on.

    Each point looks twice as far toward its root in every pass.
    """
    n = len(normals)
    links = tree.tocoo()
    one, other = np.append(links.row, np.full(len(roots), n)), np.append(links.col, roots)
    whole = coo_matrix((np.ones(len(one)), (one, other)), shape=(n + 1, n + 1)).tocsr()
    _, up = breadth_first_order(whole, n, directed=False)
    up = up.astype(np.int64)
    up[n] = n
    against = np.einsum("ij,ij->i", normals, normals[np.minimum(up[:n], n - 1)]) < 0
    sign = np.append(np.where(against & (up[:n] < n), -1.0, 1.0), 1.0)
    while (up != n).any():
        sign, up = sign * sign[up], up[up]
    return sign[:n]
