# SPDX-License-Identifier: GPL-3.0-or-later
"""What a mesh is made of, and whether it is its own mirror image."""

import numpy as np
from scipy.spatial import cKDTree

from ..mesh import Mesh


def quad_share(mesh: Mesh) -> float:
    """Share of the faces that are quads, 0..1."""
    return float((mesh.faces[:, 3] >= 0).mean())


def mirror_error(mesh: Mesh) -> tuple[float, int]:
    """Largest distance (mm) from a vertex's mirror image across x = 0 to its partner, and faces without a partner."""
    distance, partner = cKDTree(mesh.vertices).query(mesh.vertices * [-1, 1, 1])
    faces = np.where(mesh.faces >= 0, mesh.faces, mesh.faces[:, :1])
    keys = {tuple(row) for row in np.sort(faces, axis=1).tolist()}
    image = {tuple(row) for row in np.sort(partner[faces], axis=1).tolist()}
    return float(distance.max()), len(keys ^ image)
