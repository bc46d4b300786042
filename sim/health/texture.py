# SPDX-License-Identifier: GPL-3.0-or-later
"""Does any place of the texture belong to two places of the skin?"""

import numpy as np

from ..box_tree import BoxTree
from ..mesh import Mesh


def uv_triangles(mesh: Mesh) -> np.ndarray:
    """(t, 3, 2) texture coordinates of a mesh's triangles, in the order of `Mesh.triangles` up to the quads' halves."""
    uv = mesh.uv.astype(float)
    quad = mesh.faces[:, 3] >= 0
    return np.concatenate([uv[:, [0, 1, 2]], uv[quad][:, [0, 2, 3]]])


def uv_overlap(mesh: Mesh, tolerance: float = 1e-6) -> tuple[int, int]:
    """Pairs of triangles that share texture, and triangles that are turned over or have no area in it.

    Two triangles overlap when no line along a side of either parts them (separating axes); ``tolerance`` is the
    overlap, in widths of the texture, that rounding may make.
    """
    corner = uv_triangles(mesh)
    ab, ac = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    turned = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0] <= 0
    low, high = corner.min(axis=1), corner.max(axis=1)
    flat = np.zeros((len(corner), 1))
    tree = BoxTree(np.hstack([low, flat]), np.hstack([high, flat]))
    first, second = tree.overlaps(tree)
    meet = np.ones(len(first), dtype=bool)
    for side_of in (first, second):
        for k in range(3):
            rows = np.flatnonzero(meet)
            along = corner[side_of[rows], (k + 1) % 3] - corner[side_of[rows], k]
            normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
            normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
            a, b = (np.einsum("kij,kj->ki", corner[x[rows]], normal) for x in (first, second))
            depth = np.minimum(a.max(axis=1), b.max(axis=1)) - np.maximum(a.min(axis=1), b.min(axis=1))
            meet[rows[depth <= tolerance]] = False
    return int(meet.sum()), int(turned.sum())
