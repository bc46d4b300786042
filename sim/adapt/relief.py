# SPDX-License-Identifier: GPL-3.0-or-later
"""Does a fitted skin look like a face at all? Its relief against the reference's: nose, sockets, lips and chin."""

import numpy as np
from scipy.sparse import coo_matrix, diags, identity

from ..anatomy.head import Head
from ..mesh import edges, vertex_normals

ROUNDS = 60  # of averaging with the neighbours: what is smaller than a few centimetres goes


def relief(vertices: np.ndarray, faces: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(n,) mm by which a surface stands out over its own surroundings."""
    a, b = edges(faces).T
    n = len(vertices)
    link = coo_matrix((np.ones(2 * len(a)), (np.concatenate([a, b]), np.concatenate([b, a]))), shape=(n, n)).tocsr()
    degree = np.maximum(np.asarray(link.sum(axis=1)).ravel(), 1.0)
    average = 0.5 * identity(n) + diags(0.5 / degree) @ link
    smooth = vertices
    for _ in range(ROUNDS):
        smooth = average @ smooth
    return np.einsum("ij,ij->i", vertices - smooth, vertex_normals(smooth, triangles))


def face_likeness(reference: Head, vertices: np.ndarray, fitted: np.ndarray) -> float:
    """Correlation, -1..1, of the relief of a fitted skin (n, 3) with the reference's, where the face was ``fitted``.

    NaN where less than a tenth of the face was fitted.
    """
    skin = reference.skin
    face = (np.asarray(reference.groups["face"]) > 0.5) & (np.asarray(reference.groups["inner"]) <= 0.5)
    use = face & (fitted > 0.3)
    if use.sum() < 0.1 * face.sum():
        return float("nan")
    own, other = (relief(v, skin.faces, skin.triangles)[use] for v in (skin.vertices, vertices))
    return float(np.corrcoef(own, other)[0, 1])
