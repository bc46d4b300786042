# SPDX-License-Identifier: GPL-3.0-or-later
"""What stands around somebody in a scan: walls, floors and tables, large and flat. Without them the rest falls into pieces."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.spatial import cKDTree

from ..mesh import Mesh, vertex_normals
from .clean import components
from .face_match import surface_samples, thinned

APART = 20.0  # mm between the samples that are looked at,
MOST = 400  # and so many of them along the largest extent at most
AROUND = 70.0  # mm around each that tell which way it faces: phones' scans of walls are 8 mm rough
THICK = 25.0  # mm to either side of its plane that a wall takes
ALIKE = np.cos(np.radians(20))  # between its normal and that of each place in it
LARGE = 0.2e6  # mm², the smallest: a chair's back has .2 m², and of a chest or a back .07 m² lie as flat
TRIED = 300  # places through which the next wall may go,
TOLD = 20_000  # and so many that tell which of these most lie in
WALLS = 20  # that are looked for
LONG = 150.0  # mm, a side of a triangle of walls that are drawn, not scanned: the coarsest heads have sides of 30


def in_walls(mesh: Mesh, scale: float) -> np.ndarray:
    """(t,) bool: which triangles of ``mesh``, with so many mm per unit, are of something large and flat."""
    points, triangles = mesh.vertices * scale, mesh.triangles
    corners = points[triangles]
    drawn = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2).max(axis=1) > LONG
    samples = surface_samples(mesh) * scale
    cells = int(np.clip(np.ptp(samples, axis=0).max() / APART, 1, MOST))
    area = (np.ptp(samples, axis=0).max() / cells) ** 2
    samples = thinned(samples, cells)
    facing = vertex_normals(points, triangles)[cKDTree(points).query(samples)[1]]
    flat = _flat_places(samples, facing, LARGE / area)
    if not flat.any():
        return drawn
    return drawn | flat[cKDTree(samples).query(corners.mean(axis=1))[1]]


def without(mesh: Mesh, some: np.ndarray) -> Mesh:
    """``mesh`` without its triangles ``some`` (t,) bool."""
    return only(mesh, mesh.triangles[~some])


def pieces(mesh: Mesh, fewest: int) -> list[Mesh]:
    """What ``mesh`` falls into, each of ``fewest`` triangles or more, the largest in number first."""
    triangles = mesh.triangles
    if not len(triangles):
        return []
    of = components(triangles, len(mesh.vertices))[1][triangles[:, 0]]
    count = np.bincount(of)
    order = np.argsort(-count, kind="stable")
    return [only(mesh, triangles[of == which]) for which in order[count[order] >= fewest]]


def only(mesh: Mesh, triangles) -> Mesh:
    """A mesh of ``triangles`` (k, 3) of ``mesh``, and of the vertices that they use."""
    used, index = np.unique(triangles, return_inverse=True)
    return Mesh.from_triangles(mesh.vertices[used], index.reshape(-1, 3))


def _flat_places(points, facing, least):
    """(n,) bool: which of ``points`` (n, 3) mm, evenly spread, are of walls, each of ``least`` of them or more.

    facing (n, 3) : the surface's normals there
    """
    normal = _normals_at(points, facing)
    left, out = np.ones(len(points), dtype=bool), np.zeros(len(points), dtype=bool)
    for _ in range(WALLS):
        at = np.flatnonzero(left)
        if len(at) < least:
            break
        some = at[:: 1 + len(at) // TOLD]
        tried = at[:: 1 + len(at) // TRIED]
        within = (_within(points[some], normal[some], normal[k], normal[k] @ points[k]) for k in tried)
        best = points[some[max(within, key=np.count_nonzero)]]
        # Through all of them, not the one alone.
        middle = best.mean(axis=0)
        across = np.linalg.svd(best - middle, full_matrices=False)[2][-1]
        wall = at[_within(points[at], normal[at], across, across @ middle)]
        if len(wall) < least:
            break
        out[wall], left[wall] = True, False
    return out


def _within(points, normals, normal, along):
    """(n,) bool: which of ``points`` (n, 3), with their own ``normals``, lie in a plane."""
    return (np.abs(points @ normal - along) < THICK) & (np.abs(normals @ normal) > ALIKE)


def _normals_at(points, facing):
    """Unit normals (n, 3) of the planes through what lies around each of ``points`` (n, 3) mm and faces the same way."""
    n = len(points)
    pairs = cKDTree(points).query_pairs(AROUND, output_type="ndarray")
    # A board has two sides.
    pairs = pairs[np.einsum("ij,ij->i", facing[pairs[:, 0]], facing[pairs[:, 1]]) > 0]
    near = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n)).tocsr()
    near = near + near.T
    count = 1 + np.asarray(near.sum(axis=1)).ravel()
    own = points - points.mean(axis=0)
    middle = (own + near @ own) / count[:, None]
    one, other = np.triu_indices(3)
    square = own[:, one] * own[:, other]
    spread = (square + near @ square) / count[:, None] - middle[:, one] * middle[:, other]
    matrix = np.empty((n, 3, 3))
    matrix[:, one, other] = matrix[:, other, one] = spread
    return np.linalg.eigh(matrix)[1][:, :, 0]
