# SPDX-License-Identifier: GPL-3.0-or-later
"""Points of the surface drawn of a cage: its vertices, and in between them, as sparse rows over the cage.

The rows come from the limit of Catmull-Clark subdivision (`sim.mesh_subdivision.smoother`), one level fine: what is
fitted is the surface as it is drawn, and data between the vertices counts as much as data at them.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from ..mesh import Mesh, edges
from ..mesh_subdivision import smoother


@dataclass(frozen=True, eq=False)
class DrawnPoints:
    """Points of the drawn surface of a cage of n vertices.

    rows (s, n) : every point of the mesh subdivided once; the first n are the cage's own vertices, then come one for
        each edge and one for each face
    triangles (t, 3) : of that mesh
    look (s,) bool : points that look for data: all the cage's vertices around them do
    coarse (s,) bool : those of them at vertices and in the middles of faces
    """

    rows: csr_matrix
    triangles: np.ndarray
    look: np.ndarray
    coarse: np.ndarray

    @property
    def outer(self) -> np.ndarray:
        """Triangles (o, 3) between points that look for data."""
        return self.triangles[self.look[self.triangles].all(axis=1)]


def drawn_points(faces, free) -> DrawnPoints:
    """The `DrawnPoints` of a cage with ``faces`` (m, 4), of which the vertices ``free`` (n,) bool look for data."""
    n = len(free)
    rows, quads = smoother(faces, n)
    pair = edges(faces)
    real = faces >= 0
    face_free = np.where(real, free[faces], True).all(axis=1)
    look = np.concatenate([free, free[pair].all(axis=1), face_free])
    coarse = look.copy()
    coarse[n : n + len(pair)] = False
    return DrawnPoints(rows, Mesh(np.zeros((rows.shape[0], 3)), quads).triangles, look, coarse)
