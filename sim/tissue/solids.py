# SPDX-License-Identifier: GPL-3.0-or-later
"""Teeth, gums and bones as solids: how deep a point lies in one, and the nearest way out.

A solid is the outer side of a mesh, covered with points and their normals. What lies inside it, the root of a tooth in
its gum or the inner table of a skull, is no way out and is left out: a grid is flooded from without, and only triangles that
the flood reaches count.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_closing, binary_dilation, label
from scipy.spatial import cKDTree

from ..mesh import Mesh
from .geometry import TIE, short_diagonals


@dataclass(frozen=True, eq=False)
class Solid:
    """points (k, 3) mm on the outer side, normal (k, 3), material (k,) of the mesh there, and a tree of them; lower: it
    moves with the mandible; spacing mm between the points."""

    points: np.ndarray
    normal: np.ndarray
    material: np.ndarray
    tree: cKDTree
    lower: bool
    spacing: float

    def planes(self, points, rotation, translation, reach: float = 3.0):
        """Rows (c,) of the ``points`` (k, 3) within ``reach`` mm of the outer side, the normal there (c, 3), the mm (c,) that
        each lies in front of it, negative inside, and the material (c,) there."""
        if self.lower:
            points = (points - translation) @ rotation
        distance, near = self.tree.query(points, distance_upper_bound=reach)
        rows = np.flatnonzero(np.isfinite(distance))
        near, distance = near[rows], distance[rows]
        normal = self.normal[near]
        away = points[rows] - self.points[near]
        height = np.einsum("ij,ij->i", away, normal)
        # from within, the way out ends at right angles; only before a sharp edge does one lie beside what is nearest
        beside = np.flatnonzero((height < 0) & (distance**2 - height**2 > self.spacing**2))
        height[beside] = distance[beside]
        normal[beside] = away[beside] / distance[beside, None]
        return rows, normal @ rotation.T if self.lower else normal, height, self.material[near]


def build_solid(mesh: Mesh, lower: bool, about: np.ndarray, spacing: float = 0.5, reach: float = 8.0) -> Solid:
    """The solid of ``mesh`` as far as it is within ``reach`` mm of the points ``about`` (k, 3) mm; points ``spacing`` apart."""
    tri = mesh.vertices[short_diagonals(mesh.vertices, mesh.faces)]
    low, high = about.min(axis=0) - reach, about.max(axis=0) + reach
    # cells that are the same on both sides
    high[0] = np.ceil(np.abs([low[0], high[0]]).max() / spacing) * spacing
    low[0] = -high[0]
    normal = np.cross(tri[:, 1] - tri[:, 0], tri[:, 2] - tri[:, 0])
    size = np.linalg.norm(normal, axis=1)
    used = ((tri.max(axis=1) > low) & (tri.min(axis=1) < high)).all(axis=1) & (size > 1e-9)
    tri, normal = tri[used], normal[used] / size[used, None]
    kind = np.zeros(len(mesh.faces), int) if mesh.material is None else mesh.material
    quad = mesh.faces[:, 3] >= 0
    kind = np.concatenate([kind[~quad], kind[quad], kind[quad]])[used]
    points, owner = _covered(tri, spacing)
    low = low - 2 * spacing
    shape = np.ceil((high - low) / spacing).astype(int) + 3
    cell = ((np.clip(points, low, high) - low) / spacing).astype(int)
    wall = np.zeros(shape, bool)
    wall[tuple(cell.T)] = True
    wall = np.pad(wall, 2)
    wall = binary_closing(wall, iterations=2)[2:-2, 2:-2, 2:-2]  # crevices are no way in
    space, _ = label(~wall)
    outside = space == space[0, 0, 0]
    outside[tuple(((about - low) / spacing).astype(int).T)] = True  # nor is what is out already in a crevice
    outside = binary_dilation(outside, iterations=1)
    step = ((np.clip(points + 1.2 * spacing * normal[owner], low, high) - low) / spacing).astype(int)
    seen = outside[tuple(step.T)]
    points, owner = points[seen], owner[seen]
    seen = ~_buried(points, normal[owner], kind[owner], spacing)
    points, owner = points[seen], owner[seen]
    near = np.isfinite(cKDTree(about).query(points, distance_upper_bound=reach)[0])
    points, normal, kind = _once(points[near], normal[owner[near]], kind[owner[near]])
    return Solid(points, normal, kind, cKDTree(points), lower, spacing)


def _covered(tri, spacing):
    """Points (k, 3) on triangles (m, 3, 3), no farther apart than ``spacing`` mm, and the triangle (k,) of each."""
    longest = np.linalg.norm(tri - np.roll(tri, 1, axis=1), axis=2).max(axis=1)
    parts = np.ceil(longest / spacing).astype(int).clip(min=1)
    points, owner = [], []
    for k in np.unique(parts):
        which = np.flatnonzero(parts == k)
        i, j = np.meshgrid(np.arange(k + 1), np.arange(k + 1))
        inside = i + j <= k
        weight = np.stack([i[inside], j[inside], k - i[inside] - j[inside]], axis=1) / k
        points.append(np.einsum("pk,tkx->tpx", weight, tri[which]).reshape(-1, 3))
        owner.append(np.repeat(which, len(weight)))
    return np.concatenate(points), np.concatenate(owner)


def _once(points, normal, kind):
    """``points`` (k, 3) that triangles share once each, with the mean of their ``normal`` (k, 3) and the least ``kind`` (k,):
    which of several is nearest would be chance, another on either side of the head."""
    _, first, place = np.unique(np.round(points / TIE), axis=0, return_index=True, return_inverse=True)
    place = place.ravel()
    mean = np.stack([np.bincount(place, normal[:, axis]) for axis in range(3)], axis=1)
    size = np.linalg.norm(mean, axis=1)
    known = size > TIE
    least = np.full(len(first), kind.max(initial=0))
    np.minimum.at(least, place, kind)
    return points[first[known]], mean[known] / size[known, None], least[known]


def _buried(points, normal, kind, spacing):
    """(k,) bool: which ``points`` (k, 3) lie just behind the side of another ``kind`` (k,), as the gum in a tooth's neck."""
    out = np.zeros(len(points), bool)
    for one in np.unique(kind):
        own, other = np.flatnonzero(kind == one), np.flatnonzero(kind != one)
        if not len(other):
            break
        distance, near = cKDTree(points[other]).query(points[own], 8, distance_upper_bound=2 * spacing)
        found = np.isfinite(distance[:, 0])
        own, distance, near = own[found], distance[found], near[found]
        # on an edge both sides are as near: what is behind one of them only is not behind the edge
        alike = distance <= distance[:, :1] + TIE
        near = other[np.where(alike, near, 0)]
        height = np.einsum("ikj,ikj->ik", points[own, None] - points[near], normal[near])
        height = np.where(alike, height, -np.inf).max(axis=1)
        out[own] = (height < -TIE) & (distance[:, 0] ** 2 - height**2 < spacing**2)
    return out
