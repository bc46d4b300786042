# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin as it is seen: drawn of its cage, and between open lids the front of the eyeballs.

A scanner sees no lining behind the lids, it sees the eye. Without eyeballs one would look into empty sockets, so that
lining is drawn forward until it lies on the eyeball like a film between the margins of the lids. Where the lids are
shut it stays behind them. Where lips and lids end in a corner the surface is opened a little, and where what is drawn
pierces itself between the cage's vertices it is smoothed.
"""

import numpy as np
from scipy.sparse import coo_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from ..mesh import Mesh, edges
from ..mesh_smoothing import smoothed_free
from ..mesh_subdivision import smoother
from ..mesh_unfolding import unfolded
from .eyeball import reach
from .head import Eye, Head

TURNS = 4  # of smoothing and unfolding, one after the other
SHUT = 1.5  # mm: lids whose margins are nowhere farther apart are shut


def seen_skin(head: Head) -> Mesh:
    """The surface drawn of the head's skin, subdivided once, mm; the cage's own vertices come first.

    The eyes must be in their places.
    """
    skin = head.skin
    n = len(skin.vertices)
    rows, quads = smoother(skin.faces, n)
    vertices = rows @ skin.vertices
    middles = len(vertices) - len(skin.faces)
    parent = quads.max(axis=1) - middles  # every quad has the middle of its face for a corner
    for eye, side in zip(head.eyes, "lr", strict=True):
        lining = behind_lids(head, side)
        film = np.where(skin.faces >= 0, lining[skin.faces], False).any(axis=1)[parent]
        inside = np.setdiff1d(quads[film], quads[~film])
        upper, lower = (np.asarray(head.groups[f"lid_{x}_{side}"]) > 0.5 for x in ("upper", "lower"))
        margin = np.intersect1d(quads[film], quads[~film])
        upper, lower = (margin[margin < n][lid[margin[margin < n]]] for lid in (upper, lower))
        if len(inside) and len(upper) and len(lower):
            gap = cKDTree(vertices[lower]).query(vertices[upper])[0]
            if gap.max() > SHUT:
                vertices[inside] = on_eyeball(vertices, quads[film], inside, eye)
    mesh = Mesh(vertices, quads)
    out = unfolded(vertices, mesh.triangles)
    for _ in range(TURNS):  # what is smoothed may fold, and what is unfolded may pierce itself
        free = smoothed_free(out, mesh.triangles)
        if free is out:
            break
        out = unfolded(free, mesh.triangles)
    return mesh.moved(smoothed_free(out, mesh.triangles))


def on_eyeball(vertices, quads, inside, eye: Eye) -> np.ndarray:
    """Places (k, 3) mm of the vertices ``inside`` (k,) of a film of ``quads``: spread evenly between those at its edge,
    on the front of ``eye``."""
    used, local = np.unique(quads, return_inverse=True)
    local = local.reshape(quads.shape)
    a, b = edges(local).T
    link = coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(len(used), len(used))).tocsr()
    spread = (diags(np.asarray(link.sum(axis=1)).ravel()) - link).tocsr()
    free = np.isin(used, inside)
    right = -spread[free][:, ~free] @ (vertices[used[~free]] - eye.centre)
    way = spsolve(spread[free][:, free].tocsc(), right)
    far = np.linalg.norm(way, axis=1)
    way /= np.maximum(far, 1e-9)[:, None]
    gaze = eye.gaze / np.linalg.norm(eye.gaze)
    edge = np.asarray(link[free][:, ~free].sum(axis=1)).ravel() > 0
    depth = reach(eye, np.arccos(np.clip(way @ gaze, -1, 1)))
    margin = np.linalg.norm(vertices[used[~free]] - eye.centre, axis=1)
    beside = (link[free][:, ~free] @ margin)[edge] / np.asarray(link[free][:, ~free].sum(axis=1)).ravel()[edge]
    depth[edge] = (depth[edge] + beside) / 2  # the film leaves the margins of the lids gently
    return eye.centre + depth[:, None] * way


def behind_lids(head: Head, side: str) -> np.ndarray:
    """(n,) bool: vertices of the lining between the lids of the eye ``side`` and its eyeball."""
    n = len(head.skin.vertices)
    inner = np.asarray(head.groups["inner"]) > 0.5
    a, b = edges(head.skin.faces).T
    both = inner[a] & inner[b]
    link = coo_matrix((np.ones(both.sum()), (a[both], b[both])), shape=(n, n))
    label = connected_components(link, directed=False)[1]
    lids = np.maximum(*(np.asarray(head.groups[f"lid_{x}_{side}"]) for x in ("upper", "lower")))
    return inner & np.isin(label, label[inner & (lids > 0.3)])
