# SPDX-License-Identifier: GPL-3.0-or-later
"""Which vertices of one mesh lie within another: asked once for each piece that does not cut it."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ..anatomy.inside import inside
from ..mesh import Mesh
from ..mesh_piercing import piercings


def enclosed(mesh: Mesh, around: Mesh) -> np.ndarray:
    """(n,) bool: the vertices of ``mesh`` within the closed (or nearly closed) surface ``around``.

    A connected piece that pierces ``around`` nowhere lies wholly on one side of it, so one vertex answers for all.
    """
    triangles = mesh.triangles
    n = len(mesh.vertices)
    pairs = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]]])
    label = connected_components(coo_matrix((np.ones(len(pairs)), pairs.T), shape=(n, n)), directed=False)[1]
    cut = piercings(mesh.vertices, triangles, around.vertices, around.triangles)[:, 0]
    broken = np.isin(label, label[triangles[cut, 0]])
    first = np.unique(label, return_index=True)[1]
    ask = np.union1d(np.flatnonzero(broken), first)
    within = np.zeros(n, dtype=bool)
    within[ask] = inside(mesh.vertices[ask], around.vertices, around.triangles)
    return np.where(broken, within, within[first][label])
