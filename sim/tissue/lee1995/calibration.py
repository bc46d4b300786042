# SPDX-License-Identifier: GPL-3.0-or-later
"""How strong each muscle is: 3.4 gives unit vectors and no strength, so a table of what skin is seen to move decides.

The tissue's own tangent stiffness at rest, factorised once, tells how far each muscle of strength 1 would move the skin's
peak; strength is the table's millimetres over that. No other number is fitted.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from ...mesh import vertex_normals
from ..structures import Layers, Springs
from ..volume import volumes_and_gradients
from .constants import Constants
from .structures import Attachments, Elements


def tangent_stiffness(
    springs: Springs, elements: Elements, restoration: np.ndarray, nodes, triangles, constants: Constants
) -> sparse.csc_matrix:
    """(9 n, 9 n) minus the derivative of 3.3, 3.6 and the restoration at rest, node by node, x y z."""
    s = len(springs.rest)
    way = springs.difference @ nodes / springs.rest[:, None]
    blocks = springs.stiffness[:, None, None] * way[:, :, None] * way[:, None, :]
    diagonal = sparse.bsr_matrix((blocks, np.arange(s), np.arange(s + 1)), (3 * s, 3 * s))
    eye = sparse.identity(3, format="csr")
    spread = sparse.kron(springs.difference, eye, format="csr")
    stretch = spread.T @ diagonal.tocsr() @ spread
    rest = constants.shape * elements.about + sparse.diags(restoration)
    return (stretch + sparse.kron(rest, eye) + _pressure(elements, nodes, triangles, constants)).tocsc()


def _pressure(elements: Elements, nodes, triangles, constants: Constants):
    """k1 n_i dV/dx, summed over elements."""
    n3, t = len(nodes), len(elements.prisms)
    n = n3 // 3
    if not t:
        return sparse.csr_matrix((3 * n3, 3 * n3))
    _, gradient = volumes_and_gradients(nodes, elements.prisms)  # (6, 3, t)
    column = 3 * elements.prisms.T[:, None, :] + np.arange(3)[None, :, None]
    row = np.broadcast_to(np.arange(t), column.shape)
    change = sparse.csr_matrix((gradient.ravel(), (row.ravel(), column.ravel())), (t, 3 * n3))
    normal = vertex_normals(nodes[:n], triangles)
    along = sparse.csr_matrix((normal.ravel(), (np.arange(3 * n), np.repeat(np.arange(n), 3))), (3 * n3, n))
    return constants.volume * (along @ (elements.epidermal @ change))


def strengths(field: Attachments, layers: Layers, matrix: sparse.csc_matrix, extra: np.ndarray):
    """(k,) strength of each muscle (g mm/s²), and the skin's peak in mm under ``extra`` (3 n, 3), another force."""
    n = len(layers.area)
    free = np.flatnonzero(np.concatenate([layers.free, np.zeros(n, bool)]))
    rows = (3 * free[:, None] + np.arange(3)).ravel()
    owners = np.unique(field.owner)
    load = np.zeros((3 * n, 3, len(owners) + 1))
    for place, k in enumerate(owners):
        own = field.owner == k
        load[field.column[own] + n, :, place] = field.force[own]
    load[:, :, -1] = extra
    moved = splu(matrix[rows][:, rows]).solve(load[free].reshape(len(rows), -1))
    skin = np.repeat(free < n, 3)
    peak = np.sqrt((moved[skin].reshape(-1, 3, len(owners) + 1) ** 2).sum(axis=1)).max(axis=0, initial=0.0)
    out = np.zeros(len(field.names))
    out[owners] = np.where(peak[:-1] > 1e-9, field.excursion[owners] / np.maximum(peak[:-1], 1e-9), 0.0)
    return out, float(peak[-1])
