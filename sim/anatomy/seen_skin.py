# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin as it is seen: drawn of its cage, between open lids the front of the eyeballs, between open lips a film.

A scanner sees no lining behind the lids, it sees the eye. Without eyeballs one would look into empty sockets, so that
lining is drawn forward until it lies on the eyeball like a film between the margins of the lids. Nor does it see the
lining of a mouth that was left open: teeth, tongue or what the lips hold are in the way. That lining is drawn forward
to a film from lip to lip. Where lids and lips are shut it stays behind them. Where lips and lids end in a corner the
surface is opened a little, and where what is drawn pierces itself between the cage's vertices it is smoothed.
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

TURNS = 16  # at most, of smoothing and unfolding, one after the other
SHUT = 1.5  # mm: lids whose margins are nowhere farther apart are shut
CLOSED = 3.0  # mm: so are lips, which closed heads have up to 1.7 mm apart there


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
        film = _film(head, behind_lids(head, side), quads, parent)
        inside, gap = _opening(head, vertices, quads, film, f"lid_{{}}_{side}")
        if gap > SHUT:
            vertices[inside] = on_eyeball(vertices, quads[film], inside, eye)
    film = _film(head, behind_lips(head), quads, parent)
    inside, gap = _opening(head, vertices, quads, film, "lip_{}")
    if gap > CLOSED:
        vertices[inside] = spread_out(vertices, quads[film], inside)
    mesh = Mesh(vertices, quads)
    out = unfolded(vertices, mesh.triangles)
    for _ in range(TURNS):  # what is smoothed may fold, and what is unfolded may pierce itself
        free = smoothed_free(out, mesh.triangles)
        if free is out:
            break
        out = unfolded(free, mesh.triangles)
    return mesh.moved(smoothed_free(out, mesh.triangles))


def _film(head: Head, lining, quads, parent) -> np.ndarray:
    """(q,) bool: the ``quads`` drawn of those of the cage's faces that have a corner in ``lining``."""
    faces = head.skin.faces
    return np.where(faces >= 0, lining[faces], False).any(axis=1)[parent]


def _opening(head: Head, vertices, quads, film, groups: str) -> tuple[np.ndarray, float]:
    """Vertices inside a ``film`` of ``quads``, and how far apart its upper and lower edge are at most, mm.

    groups : what the vertex groups of upper and lower lid or lip are called, with ``{}`` for "upper" and "lower"
    """
    inside = np.setdiff1d(quads[film], quads[~film])
    margin = np.intersect1d(quads[film], quads[~film])
    margin = margin[margin < len(head.skin.vertices)]
    upper, lower = (margin[np.asarray(head.groups[groups.format(x)])[margin] > 0.5] for x in ("upper", "lower"))
    if not (len(inside) and len(upper) and len(lower)):
        return inside, 0.0
    return inside, float(cKDTree(vertices[lower]).query(vertices[upper])[0].max())


def spread_out(vertices, quads, inside) -> np.ndarray:
    """Places (k, 3) mm of the vertices ``inside`` (k,) of a film of ``quads``: spread evenly between those at its edge."""
    used, link = _links(quads)
    spread = (diags(np.asarray(link.sum(axis=1)).ravel()) - link).tocsr()
    free = np.isin(used, inside)
    return spsolve(spread[free][:, free].tocsc(), -spread[free][:, ~free] @ vertices[used[~free]])


def on_eyeball(vertices, quads, inside, eye: Eye) -> np.ndarray:
    """`spread_out`, on the front of ``eye``."""
    used, link = _links(quads)
    free = np.isin(used, inside)
    way = spread_out(vertices - eye.centre, quads, inside)
    far = np.linalg.norm(way, axis=1)
    way /= np.maximum(far, 1e-9)[:, None]
    gaze = eye.gaze / np.linalg.norm(eye.gaze)
    edge = np.asarray(link[free][:, ~free].sum(axis=1)).ravel() > 0
    depth = reach(eye, np.arccos(np.clip(way @ gaze, -1, 1)))
    margin = np.linalg.norm(vertices[used[~free]] - eye.centre, axis=1)
    beside = (link[free][:, ~free] @ margin)[edge] / np.asarray(link[free][:, ~free].sum(axis=1)).ravel()[edge]
    depth[edge] = (depth[edge] + beside) / 2  # the film leaves the margins of the lids gently
    return eye.centre + depth[:, None] * way


def _links(quads):
    """The vertices used by ``quads`` (k,), and which of them share a side (k, k)."""
    used, local = np.unique(quads, return_inverse=True)
    a, b = edges(local.reshape(quads.shape)).T
    return used, coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(len(used), len(used))).tocsr()


def behind_lids(head: Head, side: str) -> np.ndarray:
    """(n,) bool: vertices of the lining between the lids of the eye ``side`` and its eyeball."""
    lids = np.maximum(*(np.asarray(head.groups[f"lid_{x}_{side}"]) for x in ("upper", "lower")))
    return _lining(head, lids > 0.3)


def behind_lips(head: Head) -> np.ndarray:
    """(n,) bool: vertices of the lining of the mouth."""
    return _lining(head, np.asarray(head.groups["mouth_bag"]) > 0.5)


def _lining(head: Head, some: np.ndarray) -> np.ndarray:
    """(n,) bool: all of the lining that hangs together with ``some`` (n,) bool of it."""
    n = len(head.skin.vertices)
    inner = np.asarray(head.groups["inner"]) > 0.5
    a, b = edges(head.skin.faces).T
    both = inner[a] & inner[b]
    link = coo_matrix((np.ones(both.sum()), (a[both], b[both])), shape=(n, n))
    label = connected_components(link, directed=False)[1]
    return inner & np.isin(label, label[inner & some])
