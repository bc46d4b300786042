# SPDX-License-Identifier: GPL-3.0-or-later
"""What covers bone: the skin as modelled and as drawn, and how far bone must give way to either."""

import numpy as np
from scipy.spatial import cKDTree

from ..anatomy.inside import winding_number
from ..mesh import Mesh, edges
from ..mesh_subdivision import drawn
from .bone import NEAR
from .closest import Surface
from .cover import spread

LARGE = 9.0  # mm: triangles of linings with a longer side are looked at more closely
STEP = 3.0  # mm: the most that is asked of bone at once
NEXT = 1.5  # mm: places of the skin farther from bone than this besides what they need are left alone
SURE = 3.0  # mm: nearer than this a normal that is not plain about the side is not trusted
BESIDE = 3.0  # mm: the drawn skin is nowhere farther from the modelled one


class SkinCover:
    """The skin over bone, twice: its cage, and the surface that is drawn of it.

    Parameters
    ----------
    skin : the skin, mm; inner (n,) : weights of what lines mouth, lids and nostrils
    lining : mm of tissue that must remain between bone and such linings
    """

    def __init__(self, skin: Mesh, inner: np.ndarray, lining: float):
        self.lining = lining
        lined = inner[skin.triangles].max(axis=1) > 0.5
        sides = [skin.triangles[~lined], skin.triangles[lined]]
        self.layers, self.points, seen = [], [], []
        for vertices in (skin.vertices, drawn(skin.faces, skin.vertices)):
            self.layers.append((Surface(vertices, skin.triangles), Surface(vertices, sides[0])))
            for k, some in enumerate(sides):
                corners = vertices[some]
                at = [vertices[np.unique(some)], vertices[edges(some)].mean(axis=1), corners.mean(axis=1)]
                large = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1) > LARGE
                if k and large.any():  # linings stretch
                    at.append(spread(corners[large], LARGE / 3)[0])
                at = np.concatenate(at)
                self.points.append(at)
                seen.append(np.full(len(at), k == 0))
        #: (s, 3) places on either skin, and whether they are seen.
        self.points, self.seen = np.concatenate(self.points), np.concatenate(seen)

    def depth(self, points):
        """(k,) mm from ``points`` (k, 3) within the flesh to the nearest skin that is seen, at most `NEAR`."""
        return np.minimum.reduce([np.minimum(seen.closest(points, NEAR).distance, NEAR) for _, seen in self.layers])

    def push(self, points, need):
        """How far points of bone lie too near to the skin, and the way out of it.

        points (k, 3) mm; need (k,) mm of tissue toward the skin that is seen. Returns the displacement (k, 3) mm that
        each asks for, and (k,) mm by how much the nearer skin misses or exceeds what it needs (positive: too near).
        """
        total, worst = np.zeros((len(points), 3)), np.full(len(points), -np.inf)
        rows = np.arange(len(points))
        for whole, seen in self.layers:
            at = points[rows] + total[rows]
            depth, found = signed_depth(at, whole, NEAR)
            away, lack = _away(at, found, depth, np.full(len(at), self.lining))
            # Where the skin one sees is the nearest, or within the flesh, that must be farther.
            near = np.flatnonzero(depth < need[rows] + 0.1)
            other = seen.closest(at[near], np.inf)
            same = other.distance < np.abs(depth[near]) + 1e-6
            side = np.where((depth[near] < 0) & same, -1.0, 1.0) * other.distance
            more, less = _away(at[near], other, side, need[rows[near]])
            stronger = (less > 0) & (less > lack[near]) & ((depth[near] > 0) | same)
            away[near[stronger]], lack[near[stronger]] = more[stronger], less[stronger]
            total[rows] += away
            worst[rows] = np.maximum(worst[rows], np.maximum(lack, need[rows] - depth))
            rows = rows[depth < need[rows] + BESIDE]
        return total, worst

    def pull(self, bone: Mesh, triangles, rows, need):
        """What the places ``rows`` of the skin ask of the bone nearest to them.

        triangles (t, 3) : those of ``bone`` that may be near; need (b,) mm for each of its vertices. Returns the rows near
        enough to matter, the bone's corners (r, 3) and weights (r, 3) nearest to each, and the displacement (r, 3) mm it
        asks for there.
        """
        at = self.points[rows]
        reach = need.max() + 2.0
        surface = Surface(bone.vertices, triangles)
        depth, found = signed_depth(at, surface, reach, bone)
        near = np.flatnonzero(found.found)
        own = cKDTree(bone.vertices).query(surface.vertices)[1]  # a surface numbers its vertices anew
        corners, weights = own[surface.triangles[found.triangle[near]]], found.weights[near]
        want = np.where(self.seen[rows[near]], (weights * need[corners]).sum(axis=1), self.lining)
        off = found.points[near] - at[near]
        length = np.linalg.norm(off, axis=1)
        depth = -depth[near]  # without
        way = off / np.maximum(length, 1e-9)[:, None] * np.where(depth > 0, 1.0, -1.0)[:, None]
        way = np.where(length[:, None] > 0.05, way, -found.normals[near])
        lack = want - depth
        keep = lack > -NEXT
        return rows[near[keep]], corners[keep], weights[keep], (np.clip(lack, 0, STEP)[:, None] * way)[keep]


def signed_depth(points, surface: Surface, reach: float, whole: Mesh | None = None):
    """How deep ``points`` (k, 3) lie within a surface, mm, negative outside, at most ``reach``; and the `Contacts`.

    Most are expected within, or outside where ``surface`` is but a piece of a ``whole``, and the normal of the triangle or
    the smooth normal at the side or corner they are opposite to says so. Where it does not, the winding number is asked:
    skin folds, and bone has thin walls.
    """
    found = surface.closest(points, reach)
    depth = np.where(found.found, found.distance, reach)
    near = np.flatnonzero(found.found)
    off = points[near] - found.points[near]
    facing = (found.weights[near].min(axis=1) > 1e-6) & (whole is None)
    normal = np.where(facing[:, None], surface.face_normals[found.triangle[near]], found.normals[near])
    rise = np.einsum("ij,ij->i", off, normal)
    inner = np.full(len(points), whole is None)
    doubt = np.where(facing, 0.0, -0.3 * np.minimum(found.distance[near], SURE))
    ask = near[rise > doubt] if whole is None else near[rise < 0]
    solid = surface if whole is None else whole
    inner[ask] = winding_number(points[ask], solid.vertices, solid.triangles) > 0.5
    return np.where(inner, depth, -depth), found


def _away(at, found, depth, need):
    """Displacements (k, 3) mm that bring points ``need`` (k,) mm under the skin found, and (k,) mm what they lack."""
    lack = np.where(found.found, need - depth, -np.inf)
    off = np.where(found.found[:, None], at - found.points, 0.0)
    length = np.linalg.norm(off, axis=1, keepdims=True)
    way = off / np.maximum(length, 1e-9) * np.where(depth < 0, -1.0, 1.0)[:, None]
    # On the skin itself the way is unsure, and the skin's own normal tells.
    way = np.where(length > 0.05, way, -found.normals)
    return np.clip(lack, 0, STEP)[:, None] * way, lack
