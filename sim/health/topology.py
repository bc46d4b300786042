# SPDX-License-Identifier: GPL-3.0-or-later
"""What a mesh is made of, whether it is closed, and whether it is its own mirror image."""

import numpy as np
from scipy.spatial import cKDTree

from ..mesh import Mesh


def quad_share(mesh: Mesh) -> float:
    """Share of the faces that are quads, 0..1."""
    return float((mesh.faces[:, 3] >= 0).mean())


def closed(mesh: Mesh) -> bool:
    """Whether every edge is passed once in either direction: a surface without border, evenly turned."""
    t = mesh.triangles
    directed = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    forth = np.unique(directed, axis=0)
    return len(forth) == len(directed) and np.array_equal(forth, np.unique(directed[:, ::-1], axis=0))


def volume(mesh: Mesh) -> float:
    """mm³ that a closed mesh encloses; negative where it is turned inside out."""
    corner = mesh.vertices[mesh.triangles] - mesh.vertices.mean(axis=0)
    return float(np.einsum("ij,ij->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6)


def mirror_error(mesh: Mesh) -> tuple[float, int]:
    """Largest distance (mm) from a vertex's mirror image across x = 0 to its partner, and faces without a partner."""
    distance, partner = cKDTree(mesh.vertices).query(mesh.vertices * [-1, 1, 1])
    faces = np.where(mesh.faces >= 0, mesh.faces, mesh.faces[:, :1])
    keys = {tuple(row) for row in np.sort(faces, axis=1).tolist()}
    image = {tuple(row) for row in np.sort(partner[faces], axis=1).tolist()}
    return float(distance.max()), len(keys ^ image)
