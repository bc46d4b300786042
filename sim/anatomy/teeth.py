# SPDX-License-Identifier: GPL-3.0-or-later
"""Which vertices of a row of teeth are crowns and gum, and which are roots."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ..mesh import Mesh

#: Rings of a tooth, and how many of them are its root.
ROWS, ROOT_ROWS = 12, 4


def crowns(mesh: Mesh) -> np.ndarray:
    """(n,) bool: vertices of the crowns; all of them for a part without teeth.

    Every tooth is a piece of its own, ring by ring from the tip of its root; roots stand in bone, outside the mouth.
    """
    out = np.ones(len(mesh.vertices), dtype=bool)
    if mesh.material is None or len(np.unique(mesh.material)) < 2:
        return out
    enamel = mesh.faces[mesh.material == 0]
    rows = np.unique(enamel[enamel >= 0])
    links = np.concatenate([enamel[:, :2], enamel[:, 1:3]])
    n = len(out)
    label = connected_components(coo_matrix((np.ones(len(links)), links.T), shape=(n, n)), directed=False)[1][rows]
    order = np.argsort(label, kind="stable")
    _, start, count = np.unique(label[order], return_index=True, return_counts=True)
    place = np.arange(len(rows)) - np.repeat(start, count)
    out[rows[order]] = place * ROWS >= ROOT_ROWS * np.repeat(count, count)
    return out
