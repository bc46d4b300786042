# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin as it is seen: drawn of its cage, without what the eyeballs hide."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ..mesh import Mesh, edges
from ..mesh_subdivision import smoother
from .head import Head


def seen_skin(head: Head) -> Mesh:
    """The surface drawn of the head's skin, subdivided once, in triangles (mm).

    The lining behind the lids, which the eyeballs hide from every side, is left out: without eyeballs one would look
    into empty sockets. The other vertices of the cage come first, as they lie on that surface.
    """
    skin = head.skin
    rows, quads = smoother(skin.faces, len(skin.vertices))
    hidden = behind_lids(head)
    kept = ~np.where(skin.faces >= 0, hidden[skin.faces], False).any(axis=1)
    middles = rows.shape[0] - len(skin.faces)  # every quad has the middle of its face for a corner
    quads = quads[kept[quads.max(axis=1) - middles]]
    used, back = np.unique(quads, return_inverse=True)
    return Mesh(rows[used] @ skin.vertices, back.reshape(quads.shape).astype(np.int32))


def behind_lids(head: Head) -> np.ndarray:
    """(n,) bool: vertices of the lining between lids and eyeballs."""
    n = len(head.skin.vertices)
    inner = np.asarray(head.groups["inner"]) > 0.5
    a, b = edges(head.skin.faces).T
    both = inner[a] & inner[b]
    link = coo_matrix((np.ones(both.sum()), (a[both], b[both])), shape=(n, n))
    label = connected_components(link, directed=False)[1]
    lids = np.maximum.reduce([np.asarray(head.groups[f"lid_{x}_{s}"]) for x in ("upper", "lower") for s in "lr"])
    return inner & np.isin(label, label[inner & (lids > 0.3)])
