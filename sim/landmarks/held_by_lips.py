# SPDX-License-Identifier: GPL-3.0-or-later
"""What somebody holds between the lips, a breathing tube for one: it stands off the lips and chin, and is no skin.

A plausible head laid on the scan (`shape_fit`) gives up what no face explains; what is left standing off it there, in one
piece and that high, is held by the lips.
"""

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..adapt.closest import Surface
from .shape_fit import ShapeFit
from .shape_space import ShapeSpace

#: mm, all on a head of the reference's size. Faces in 19 scans, smiling or not, stand off by up to 6.3 mm over more than
#: 40 mm²; a breathing tube by 11.5 over 500.
AROUND = 45.0  # from where the lips meet that is looked at
REACH = 25.0  # that a thing may stand off
OFF = 3.0  # by which it does in most places
HIGH = 8.0  # and somewhere
LEAST = 60.0  # mm² of it
LOW, BEYOND = 1.0, 10.0  # by which it does where the lips hold it; so far from where it stands off more
BESIDE = 2.0  # to which it hides what is next to it


def held_by_lips(space: ShapeSpace, fit: ShapeFit, target: Surface) -> np.ndarray:
    """(m,) bool: the triangles of ``target`` that show what is held between the lips, and what lies just beside."""
    size = fit.pose.scale
    mouth = space.landmarks(fit.points)["sto"]
    near = np.flatnonzero(np.linalg.norm(target.vertices - mouth, axis=1) < (AROUND + REACH) * size)
    off = np.zeros(len(target.vertices))
    off[near] = height(space, fit, target.vertices[near], mouth) / size
    piece, area = pieces(target, off > OFF)
    high = np.zeros(len(area))
    np.maximum.at(high, piece, off)
    held = ((high > HIGH) & (area > LEAST * size**2))[piece] & (off > OFF)
    if held.any():
        apart = np.full(len(off), np.inf)
        apart[near] = cKDTree(target.vertices[held]).query(target.vertices[near])[0] / size
        piece, area = pieces(target, (off > LOW) & (apart < BEYOND))
        whole = np.zeros(len(area), dtype=bool)
        whole[piece[held]] = True
        held = whole[piece]
        held[near] = cKDTree(target.vertices[held]).query(target.vertices[near])[0] <= BESIDE * size
    return held[target.triangles].any(axis=1)


def pieces(target: Surface, some):
    """Which piece (n,) of what triangles between vertices ``some`` (n,) bool make up each vertex belongs to, and the area
    (k,) mm² of the pieces."""
    inside = some[target.triangles].all(axis=1)
    a, b, c = target.triangles[inside].T
    n = len(some)
    link = csr_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, c])), shape=(n, n))
    count, piece = connected_components(link, directed=False)
    return piece, np.bincount(piece[a], target.area[inside], count)


def height(space: ShapeSpace, fit: ShapeFit, points, mouth) -> np.ndarray:
    """(k,) mm by which ``points`` (k, 3) stand off the skin laid on the scan, about the ``mouth`` (3,); elsewhere 0.

    Before the gap between parted lips, where there is no skin, they stand off its edge, forward.
    """
    size, forward = fit.pose.scale, -fit.pose.turn[:, 1]
    found = Surface(fit.points, space.triangles).closest(points, REACH * size)
    about = found.found & (np.linalg.norm(found.points - mouth, axis=1) < AROUND * size)
    way = np.where(found.border[:, None], forward, found.normals)
    return np.where(about, np.einsum("ij,ij->i", points - np.nan_to_num(found.points), way), 0.0)
