# SPDX-License-Identifier: GPL-3.0-or-later
"""Bone kept inside the skin: the smoothest displacement that leaves tissue everywhere over it."""

import numpy as np
from scipy.sparse import csr_matrix, diags, identity, vstack

from ..mesh import Mesh
from ..progress import Progress, Work, finish
from .bone import THIN
from .skin_cover import SkinCover
from .smooth_system import factorised, laplacian

FREE = 3.0  # mm: what is deeper by this than it must be, stays so
SLACK, MORE = 0.05, 0.06  # mm: so much may lack, so much more is asked for than lacks
#: Weight of what is asked against the bending of the bone, its growth from round to round, and where that ends.
FIRM, FIRMER, FIRMEST = 4.0, 3.0, 400.0


def keep_inside(bone: Mesh, cover: SkinCover, least, rounds: int = 12) -> np.ndarray:
    """`keeping_inside`, at once."""
    return finish(keeping_inside(bone, cover, least, rounds))


def keeping_inside(bone: Mesh, cover: SkinCover, least, rounds: int = 12) -> Work:
    """Work returning bone vertices (n, 3) moved smoothly until all lie ``least`` (n,) mm or deeper under the skin.

    The displacement has the least bending energy among those that give what is asked at all places found too near:
    places of the bone under the skin, and places of the skin over the bone, since either may have the larger faces.
    What is still lacking is asked for again with more weight.
    """
    start = bone.vertices
    n = len(start)
    yield Progress(0.0, "Bone under the skin")
    bend = laplacian(start, bone.faces)
    smooth = (bend.T @ bend + 0.02 * identity(n)).tocsr()
    look = vstack([identity(n), middles(bone.triangles, n)]).tocsr()
    need = np.concatenate([least, np.minimum(least[bone.triangles].min(axis=1), THIN)])
    above = np.arange(len(cover.points))
    lack = cover.push(start, need[:n])[1]
    there = lack > -FREE  # what is that much deeper than it must be, stays so
    if not there.any():
        return start
    triangles = bone.triangles[there[bone.triangles].any(axis=1)]
    watch = np.concatenate([np.flatnonzero(there), n + np.flatnonzero(there[bone.triangles].any(axis=1))])
    look, need = look[watch], need[watch]
    asked = Asked(look, len(cover.points))
    lack, checked = np.full(len(watch), np.inf), np.zeros((len(watch), 3))
    moved = start
    for turn in range(rounds):
        yield Progress((turn + 1) / (rounds + 1), "Bone under the skin")
        now = look @ (moved - start)
        # A place that went on by less than it has to spare needs no other look.
        again = np.flatnonzero(lack + np.linalg.norm(now - checked, axis=1) > -SLACK)
        push, lack[again] = cover.push(look[again] @ start + now[again], need[again])
        checked[again] = now[again]
        wrong = np.linalg.norm(push, axis=1) > SLACK
        yield Progress((turn + 1.3) / (rounds + 1), "Bone under the skin")
        above, corners, weights, pull = cover.pull(bone.moved(moved), triangles, above, least)
        wants = np.linalg.norm(pull, axis=1) > SLACK
        if not wrong.any() and not wants.any():
            break
        yield Progress((turn + 1.6) / (rounds + 1), "Bone under the skin")
        asked.places(again[wrong], longer(push[wrong]), now)
        asked.over(above[wants], corners[wants], weights[wants], longer(pull[wants]), moved - start)
        rows, weight, goal = asked.system()
        moved = start + factorised((smooth + rows.T @ weight @ rows).tocsc())(rows.T @ (weight @ goal))
    return moved


class Asked:
    """What has been asked of a displacement: rows of weights on vertices, the displacement wanted there, how strongly.

    look (p, n) : the places of the bone, rows of weights; over : the number of places of the skin
    """

    def __init__(self, look, over: int):
        self.look, self.n = look, look.shape[1]
        self.goal = np.zeros((look.shape[0] + over, 3))
        self.weight = np.zeros(look.shape[0] + over)
        self.corners, self.shares = np.zeros((over, 3), dtype=np.int64), np.zeros((over, 3))

    def places(self, rows, push, so_far):
        """Places ``rows`` of the bone must go on by ``push`` (r, 3) mm from where displacements (p, 3) took them all."""
        self._ask(rows, so_far[rows] + push)

    def over(self, rows, corners, shares, push, so_far):
        """The same for the points of the bone that lie nearest to places ``rows`` of the skin; so_far (n, 3) mm."""
        self.corners[rows], self.shares[rows] = corners, shares
        self._ask(self.look.shape[0] + rows, np.einsum("rk,rkx->rx", shares, so_far[corners]) + push)

    def _ask(self, rows, goal):
        self.goal[rows] = goal
        self.weight[rows] = np.where(self.weight[rows] > 0, np.minimum(FIRMER * self.weight[rows], FIRMEST), FIRM)

    def system(self):
        """Rows (r, n), their weights (r, r) and the displacements wanted there (r, 3)."""
        count = self.look.shape[0]
        some = np.flatnonzero(self.weight[:count])
        more = np.flatnonzero(self.weight[count:])
        index = (np.repeat(np.arange(len(more)), 3), self.corners[more].ravel())
        skin = csr_matrix((self.shares[more].ravel(), index), shape=(len(more), self.n))
        rows = np.concatenate([some, count + more])
        return vstack([self.look[some], skin]).tocsr(), diags(self.weight[rows]), self.goal[rows]


def longer(push):
    """Displacements (k, 3) mm made `MORE` longer."""
    return push * (1 + MORE / np.linalg.norm(push, axis=1, keepdims=True))


def middles(triangles, n) -> csr_matrix:
    """(t, n) sparse rows that give the middle of each triangle (t, 3) of n vertices."""
    rows = np.repeat(np.arange(len(triangles)), 3)
    return csr_matrix((np.full(len(rows), 1 / 3), (rows, triangles.ravel())), shape=(len(triangles), n))
