# SPDX-License-Identifier: GPL-3.0-or-later
"""The edges of the lids on the limit surface, and the strips across the lids that end at them."""

import numpy as np

from ..anatomy.head import Head
from ..angles import bearing
from ..mesh import edges
from ..mesh_subdivision import limit, subdivision


class LidEdge:
    """How far the edges of the lids reach on the limit surface: subdivision rounds them off.

    column : (v,) skin vertices of both lids; edge, inner : (v,) bool, on the margin, behind it
    frame : (3, 3) rows along the lid, forward, up; centre : (3,) mm of the eyeball
    rows : (k,) rows of ``column`` on the margin, each with its neighbour on the outer skin
    """

    def __init__(self, head: Head, column, edge, inner, frame, centre):
        faces = head.skin.faces
        near = np.zeros(len(head.skin.vertices), dtype=bool)
        near[column] = True
        for _ in range(2):
            near[faces[near[faces].any(axis=1)].ravel()] = True
        faces = faces[(near[faces] | (faces < 0)).all(axis=1)]
        self.used = np.unique(faces[faces >= 0])
        faces = np.where(faces >= 0, np.searchsorted(self.used, faces), -1)
        fine, quads, _ = subdivision(faces, len(self.used))
        local = np.searchsorted(self.used, column)
        row = np.full(len(self.used), -1)
        row[local] = np.arange(len(column))
        pairs = edges(faces)
        ends = row[pairs]
        outer = np.append(~edge & ~inner, False)
        found = [(np.append(edge, False)[ends[:, k]] & outer[ends[:, 1 - k]]) for k in (0, 1)]
        spots = np.concatenate([np.flatnonzero(f) for f in found])
        first = np.concatenate([pairs[f, k] for k, f in enumerate(found)])
        second = np.concatenate([pairs[f, 1 - k] for k, f in enumerate(found)])
        self.rows = row[first]
        points = np.concatenate([first, len(self.used) + spots, second])
        self.smooth = limit(quads, fine.shape[0])[points] @ fine
        self.frame, self.centre = frame, centre

    def reach(self, vertices, upper):
        """(k,) mm along the lid and (k,) rad: the lowest of an upper, the highest of a lower edge."""
        a, f, u = ((self.smooth @ vertices[self.used] - self.centre) @ self.frame.T).T.reshape(3, 3, -1)
        angle = bearing(u, f)
        best = np.where(upper[self.rows], angle.argmin(axis=0), angle.argmax(axis=0))[None]
        return np.take_along_axis(a, best, 0)[0], np.take_along_axis(angle, best, 0)[0]

    def gap(self, vertices, upper, within):
        """(v,) rad from the lower up to the upper edge at each place ``within`` (v,) mm along the lid, less than 0 where
        they overlap.
        """
        at, level = self.reach(vertices, upper)
        of_upper = upper[self.rows]
        order = np.argsort(at, kind="stable")
        high, low = order[of_upper[order]], order[~of_upper[order]]
        return np.interp(within, at[high], level[high]) - np.interp(within, at[low], level[low])


def strips(pair, column, start, points) -> tuple[np.ndarray, np.ndarray]:
    """(v,) for each lid vertex the entry of ``start`` (rows on the margin) whose strip across the lid it belongs to, and
    (v,) mm along that strip from the margin; -1 and 0 where it belongs to none.

    points : (n, 3) mm, the whole skin's
    """
    row = np.full(len(points), -1)
    row[column] = np.arange(len(column))
    ends = row[pair]
    ends = ends[(ends >= 0).all(axis=1)]
    ends = np.concatenate([ends, ends[:, ::-1]])
    step = np.linalg.norm(points[column[ends[:, 0]]] - points[column[ends[:, 1]]], axis=1)
    root, length = np.full(len(column), -1), np.zeros(len(column))
    root[start] = np.arange(len(start))
    for _ in range(8):
        new = np.flatnonzero((root[ends[:, 0]] >= 0) & (root[ends[:, 1]] < 0))[::-1]
        if not len(new):
            break
        before, after = ends[new].T
        root[after] = root[before]
        length[after] = length[before] + step[new]
    return root, length
