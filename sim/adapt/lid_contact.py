# SPDX-License-Identifier: GPL-3.0-or-later
"""Lids brought to lie on an eyeball: the surface that is drawn of them, and the cage it is drawn of.

Both are sampled all over their triangles, since the chord between two points on a ball cuts it. Every lid vertex moves
along the ray from the ball's centre only; the moves are the smallest and smoothest with which all samples keep their
distance. That is a least-squares problem with bounds, solved by an active set of quadratic penalties, linearised anew
each round (Nocedal and Wright 2006, 17.1).
"""

import numpy as np
from scipy.linalg import solve
from scipy.sparse import coo_matrix, csr_matrix, vstack

from ..anatomy.eyeball import reach
from ..anatomy.head import Eye
from ..mesh import edges
from ..mesh_subdivision import smoother

#: mm over the ball that samples of the lids aim at: the inner edge of the margins at least and most, the rest at least.
EDGE, BEHIND = (0.07, 0.38), 0.05
EASE = 0.02  # mm: where the inner edge must come nearer it aims at so much less than its bound, as its neighbours hold it off
#: mm that the lids' backs may stand farther off than they do on the reference.
NEAR = 0.5
#: Rounds, those after which the best is kept, and weights of a violated bound and of smoothness against that of moving at all.
ROUNDS, SETTLED, FIRM, SMOOTH = 30, 20, 3000.0, 0.6

#: How hard vertices are to move: lid backs and inner edge, then the seen lid one, two and three edges before it.
BACK, SEEN = 0.02, (1.0, 4.0, 16.0)

_CORNERS = np.eye(3)
_INSIDE = np.array(
    [[0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.25, 0.25], [0.25, 0.5, 0.25], [0.25, 0.25, 0.5]]
)
_FINE = np.array([[0.75, 0.25, 0], [0, 0.75, 0.25], [0.25, 0, 0.75], [0.25, 0.75, 0], [0, 0.25, 0.75], [0.75, 0, 0.25]])


def height_over(points, eye: Eye) -> np.ndarray:
    """(k,) mm from the eyeball, cornea included, out to points (k, 3), along the ray from its centre."""
    away = points - eye.centre
    length = np.linalg.norm(away, axis=1)
    return length - reach(eye, np.arccos(np.clip(away @ eye.gaze / np.maximum(length, 1e-9), -1, 1)))


class LidContact:
    """Samples of the lids of one eye, cage and drawn surface, as rows of a matrix over the skin's vertices.

    faces (m, 4) and triangles (t, 3) : the skin's; count : its vertices
    stiff : (count,) how hard each vertex is to move; infinite: it stays
    edge : (k,) vertices of the inner edge of the margins that lie on the ball
    back : (b,) vertices of the lids' backs, which stay about as near to it as `allow` finds them (none: they need not)
    """

    def __init__(self, faces, triangles, count: int, stiff, edge, back=()):
        self.edge = edge
        self.rows = np.flatnonzero(np.isfinite(stiff))
        self.stiff = np.asarray(stiff, float)[self.rows]
        free = np.zeros(count, dtype=bool)
        free[self.rows] = True
        operator, quads = smoother(faces, count)
        fine = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
        touched = np.zeros(operator.shape[0], dtype=bool)
        touched[np.unique(operator[:, self.rows].tocoo().row)] = True
        samples = [
            _samples(triangles[free[triangles].any(axis=1)], np.concatenate([_CORNERS, _INSIDE, _FINE]), count),
            _samples(fine[touched[fine].any(axis=1)], np.concatenate([_CORNERS, _INSIDE]), operator.shape[0])
            @ operator,
        ]
        at_edge = coo_matrix((np.ones(len(edge)), (np.arange(len(edge)), edge)), shape=(len(edge), count)).tocsr()
        self.back = np.asarray(back, dtype=int)
        samples = [at_edge, operator[edge], *samples, operator[self.back]]
        size = [part.shape[0] for part in samples]
        self.all = vstack(samples).tocsr()
        self.least = np.repeat([EDGE[0], EDGE[0], BEHIND, BEHIND, BEHIND], size)
        self.most = np.repeat([EDGE[1], EDGE[1], np.inf, np.inf, np.inf], size)
        self.own = self.all[:, self.rows].toarray()
        link = _links(faces, count)[self.rows][:, self.rows].toarray()
        self.bend = np.diag(link.sum(axis=1)) - link

    def allow(self, points, eye: Eye) -> None:
        """Take what the skin (n, 3) mm of ``eye`` has itself as good enough."""
        height = height_over(self.all @ points, eye) * 12.0 / eye.radius
        self.least, self.most = np.minimum(self.least, height - 1e-6), np.maximum(self.most, height + 1e-6)
        first = len(height) - len(self.back)
        self.most[first:] = np.maximum(height[first:], BEHIND) + NEAR

    def settled(self, points, eye: Eye, near=None) -> np.ndarray:
        """Skin (n, 3) mm with the lids moved as little as they must to lie on ``eye``.

        near : (k,) 0..1, how far vertices of ``edge`` must do so whatever was allowed (None: not at all)
        """
        out = np.array(points, dtype=float)
        start = out[self.rows] - eye.centre
        ray = start / np.maximum(np.linalg.norm(start, axis=1, keepdims=True), 1e-9)
        rest = np.diag(self.stiff) + SMOOTH * self.bend.T @ self.bend
        size = eye.radius / 12.0
        least, most = self.least * size, self.most * size
        if near is not None:
            edge, share = slice(2 * len(self.edge)), np.tile(near, 2)
            most[edge] += share * (EDGE[1] * size - most[edge])
            bound = most[edge] / max(size, 1.0)  # the lids of a larger eye stand no farther off it
            off = height_over(self.all[edge] @ out, eye) > bound  # lids that lie well stay where they are
            most[edge] = np.maximum(bound - EASE * off, least[edge])
        move = np.zeros(len(self.rows))
        best, least_wrong = None, np.inf
        for turn in range(ROUNDS):
            samples = self.all @ out
            height = height_over(samples, eye)
            goal = np.clip(height, least, most)
            miss = np.abs(goal - height)
            if turn >= SETTLED and miss.max() < least_wrong:  # bounds come into reach and go until the end
                best, least_wrong = out.copy(), miss.max()
            active = np.flatnonzero(miss > 0)
            if not len(active):
                return out
            away = samples[active] - eye.centre
            away /= np.linalg.norm(away, axis=1, keepdims=True)
            along = self.own[active] * (away @ ray.T)
            aim = along @ move + (goal - height)[active]
            new = solve(rest + FIRM * along.T @ along, FIRM * along.T @ aim, assume_a="pos")
            move = move + 0.7 * (new - move)
            out[self.rows] = eye.centre + start + move[:, None] * ray
        return best


def _samples(triangles, shares, count) -> csr_matrix:
    """(t * s, count): points at barycentric ``shares`` (s, 3) of triangles (t, 3)."""
    k = len(triangles) * len(shares)
    row = np.repeat(np.arange(k), 3)
    column = np.repeat(triangles, len(shares), axis=0).ravel()
    return coo_matrix((np.tile(shares, (len(triangles), 1)).ravel(), (row, column)), shape=(k, count)).tocsr()


def _links(faces, count) -> csr_matrix:
    """(count, count): 1 where an edge joins two vertices."""
    a, b = edges(faces).T
    return coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(count, count)).tocsr()
