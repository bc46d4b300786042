# SPDX-License-Identifier: GPL-3.0-or-later
"""Points of the surface drawn of a cage: its vertices, and in between them, as sparse rows over the cage.

The rows come from the limit of Catmull-Clark subdivision (`sim.mesh_subdivision.smoother`), one level fine: what is
fitted is the surface as it is drawn, and data between the vertices counts as much as data at them.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags, identity

from ..mesh import Mesh, edges
from ..mesh_subdivision import smoother

SAG = 0.25  # of the way to the mean of the points beside; 1/3 for an even grid of flat quads, 0 for the smooth surface


@dataclass(frozen=True, eq=False)
class DrawnPoints:
    """Points of the drawn surface of a cage of n vertices.

    rows (s, n) : every point of the mesh subdivided once; the first n are the cage's own vertices, then come one for
        each edge and one for each face
    triangles (t, 3) : of that mesh
    seen (s,) bool : points a scanner can see: all the cage's vertices around them are seen
    around (s, s) : mean of the points beside each
    look (s,) bool : points that look for data, likewise
    """

    rows: csr_matrix
    triangles: np.ndarray
    around: csr_matrix
    seen: np.ndarray
    look: np.ndarray

    def between(self, points) -> np.ndarray:
        """``points`` (s, 3) moved to where the flat triangles around them lie in the mean: a curved surface bulges over
        them, and is to be as far outside the data at its points as inside it between them."""
        return points + SAG * (self.around @ points - points)

    @cached_property
    def outer(self) -> np.ndarray:
        """Triangles (o, 3) between points that are seen."""
        return self.triangles[self.seen[self.triangles].all(axis=1)]


def drawn_points(faces, free, seen) -> DrawnPoints:
    """The `DrawnPoints` of a cage with ``faces`` (m, 4), of which the vertices ``free`` (n,) bool look for data and
    ``seen`` (n,) bool can be seen. Kept for those last asked for."""
    faces = np.ascontiguousarray(faces, dtype=np.int32)
    return _drawn_points(
        faces.tobytes(), faces.shape, *(np.asarray(each, dtype=bool).tobytes() for each in (free, seen))
    )


@lru_cache(maxsize=2)
def _drawn_points(faces: bytes, shape, free: bytes, seen: bytes) -> DrawnPoints:
    faces = np.frombuffer(faces, dtype=np.int32).reshape(shape)
    free, seen = (np.frombuffer(chosen, dtype=bool) for chosen in (free, seen))
    n = len(free)
    rows, quads = smoother(faces, n)
    pair = edges(faces)

    def between(chosen):
        return np.concatenate([chosen, chosen[pair].all(axis=1), np.where(faces >= 0, chosen[faces], True).all(axis=1)])

    a, b = edges(quads).T
    link = coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(rows.shape[0],) * 2).tocsr()
    around = (diags(1 / np.maximum(np.asarray(link.sum(axis=1)).ravel(), 1)) @ link).tocsr()
    triangles = Mesh(np.zeros((rows.shape[0], 3)), quads).triangles
    return DrawnPoints(rows, triangles, around, between(seen), between(free))


def own_points(faces, free, seen) -> DrawnPoints:
    """`drawn_points` with the vertices alone, of a cage that is drawn as it is."""
    n = len(free)
    rows = identity(n, format="csr")
    return DrawnPoints(rows, Mesh(np.zeros((n, 3)), faces).triangles, rows, seen, free)
