# SPDX-License-Identifier: GPL-3.0-or-later
"""Things that are no skin: what no face explains, and what stands off it in one piece and high."""

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..adapt.closest import Surface
from .shape_fit import ShapeFit
from .shape_space import ShapeSpace

#: mm, all on a head of the reference's size.
OFF = 3.0  # that a thing stands off the skin in most places
LOW, BEYOND = 1.0, 10.0  # by which it does where it meets the skin; so far from where it stands off more
BESIDE = 2.0  # to which it hides what is next to it
REACH = 25.0  # that it may stand off


def things(target: Surface, near, off, size: float, high: float, least: float) -> np.ndarray:
    """(n,) bool: the vertices of ``target`` that show things, and what lies just beside those.

    near (k,) : those that are looked at; off (n,) mm by which each stands off the skin, on a head of the reference's size
    size : of this head, of the reference's; high : mm that a thing stands off somewhere; least : mm² of it
    """
    some = high_pieces(target, off, OFF, high, least * size**2)
    if some.any():
        apart = np.full(len(off), np.inf)
        apart[near] = cKDTree(target.vertices[some]).query(target.vertices[near])[0] / size
        piece, area = pieces(target, (off > LOW) & (apart < BEYOND))
        whole = np.zeros(len(area), dtype=bool)
        whole[piece[some]] = True
        some = whole[piece]
        some[near] = cKDTree(target.vertices[some]).query(target.vertices[near])[0] <= BESIDE * size
    return some


def high_pieces(target: Surface, off, by: float, high: float, least: float) -> np.ndarray:
    """(n,) bool: the vertices of ``target`` in pieces that stand off by more than ``by`` mm, somewhere by more than ``high``,
    and are larger than ``least`` mm². ``off`` (n,) mm by which each stands off."""
    piece, area = pieces(target, off > by)
    top = np.zeros(len(area))
    np.maximum.at(top, piece, off)
    return ((top > high) & (area > least))[piece] & (off > by)


def pieces(target: Surface, some):
    """Which piece (n,) of what triangles between vertices ``some`` (n,) bool make up each vertex belongs to, and the area
    (k,) mm² of the pieces."""
    inside = some[target.triangles].all(axis=1)
    a, b, c = target.triangles[inside].T
    n = len(some)
    link = csr_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, c])), shape=(n, n))
    count, piece = connected_components(link, directed=False)
    return piece, np.bincount(piece[a], target.area[inside], count)


def standing_off(space: ShapeSpace, fit: ShapeFit, target: Surface, near, inside=None) -> np.ndarray:
    """(n,) mm, on a head of the reference's size, by which the vertices of ``target`` stand off the skin laid on it.

    near (k,) : those that are looked at; inside : whether they are where such a thing may be, of their feet (k, 3) mm on
    the skin (None: all are). Elsewhere 0. Before an opening of the skin, as between parted lips, they stand off its edge,
    forward.
    """
    out, size, forward = np.zeros(len(target.vertices)), fit.pose.scale, -fit.pose.turn[:, 1]
    points = target.vertices[near]
    found = Surface(fit.points, space.triangles).closest(points, REACH * size)
    way = np.where(found.border[:, None], forward, found.normals)
    height = np.einsum("ij,ij->i", points - np.nan_to_num(found.points), way) / size
    there = found.found if inside is None else found.found & inside(found.points)
    out[near] = np.where(there, height, 0.0)
    return out
