# SPDX-License-Identifier: GPL-3.0-or-later
"""A sparse positive matrix solved by dense blocks, for many right sides that come one after the other.

The nodes are parted (nested dissection: George 1973, SIAM J. Numer. Anal. 10, 345) into blocks that meet only across nodes
between them. With the inverses of the blocks and of the Schur complement between, a solution is a few products of dense
matrices (block elimination: Golub and Van Loan 2013, 3.2.11), in half the time of substitution along sparse triangles. In
single precision: good for directions, which are corrected as they go.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import maximum_bipartite_matching
from scipy.sparse.linalg import eigsh

#: Nodes of a block, about.
BLOCK = 400
#: Where blocks may be cut, as shares of their nodes; nodes between that one node less in the larger half is worth.
_SHARES, _EVEN = (0.4, 0.45, 0.5, 0.55, 0.6), 0.3


class Dissection:
    """The inverse of a sparse symmetric positive ``matrix`` (m, m), its nodes parted into ``blocks`` and those ``between``
    (`parted`)."""

    def __init__(self, matrix, blocks, between):
        self._order = np.concatenate([*blocks, between])
        stops = np.cumsum([0, *(len(block) for block in blocks)])
        self._inner = int(stops[-1])
        matrix = sparse.csr_matrix(matrix)[self._order][:, self._order]
        self._across = matrix[self._inner :, : self._inner].astype(np.float32)
        schur = matrix[self._inner :, self._inner :].toarray()
        self._blocks = []
        for start, stop in zip(stops[:-1], stops[1:], strict=True):
            inverse = np.linalg.inv(matrix[start:stop, start:stop].toarray())
            coupled = matrix[self._inner :, start:stop]
            rows = np.flatnonzero(np.diff(coupled.indptr))
            coupled = coupled[rows]
            follows = (coupled @ inverse).T
            schur[np.ix_(rows, rows)] -= coupled @ follows
            self._blocks.append((slice(start, stop), inverse.astype(np.float32), rows, follows.astype(np.float32)))
        self._schur = np.linalg.inv(schur).astype(np.float32)

    def solve(self, right):
        """(m, k): the solution for the columns of ``right`` (m, k)."""
        right = np.take(right, self._order, axis=0).astype(np.float32)
        found = np.empty_like(right)
        inner, between = found[: self._inner], found[self._inner :]
        for block, inverse, _, _ in self._blocks:
            np.matmul(inverse, right[block], out=inner[block])
        between[:] = self._schur @ (right[self._inner :] - self._across @ inner)
        for block, _, rows, follows in self._blocks:  # how a block follows those between that it meets
            inner[block] -= follows @ between[rows]
        out = np.empty(right.shape, np.float32, order="F")  # each column by itself, as they are used
        out[self._order] = found
        return out


def parted(matrix, places):
    """Blocks of the nodes at ``places`` (m, 3), a list of arrays, that the sparse symmetric ``matrix`` (m, m) does not
    couple, and the nodes between them (b,)."""
    blocks, between = [np.arange(len(places))], [np.zeros(0, int)]
    while max(map(len, blocks)) > 1.5 * BLOCK:
        cuts = [_cut(matrix[block][:, block].tocsr(), places[block]) for block in blocks]
        between += [block[middle] for block, (*_, middle) in zip(blocks, cuts, strict=True)]
        blocks = [block[half] for block, cut in zip(blocks, cuts, strict=True) for half in cut[:2]]
    return blocks, np.concatenate(between)


def _cut(matrix, places):
    """Two halves of the nodes that are not coupled, and the few between: along the second eigenvector of the graph's
    Laplacian (Pothen, Simon and Liou 1990, SIAM J. Matrix Anal. Appl. 11, 430)."""
    graph = (matrix != 0).astype(float)
    laplacian = sparse.diags(np.asarray(graph.sum(axis=1)).ravel() + 1e-3) - graph
    wide = places[:, np.argmax(np.ptp(places, axis=0))]
    value, vector = eigsh(laplacian.tocsc(), k=2, sigma=0, v0=wide - wide.mean() + 1e-3, tol=1e-3)
    order = np.argsort(vector[:, np.argmax(value)], kind="stable")
    best, least = None, np.inf
    for share in _SHARES:
        first, second = np.split(order, [int(share * len(order))])
        one, other = _cover(graph[first][:, second].tocsr())
        size = max((~one).sum(), (~other).sum())
        cost = one.sum() + other.sum() + _EVEN * max(size - len(order) / 2, 0)
        if cost < least:
            best, least = (first[~one], second[~other], np.concatenate([first[one], second[other]])), cost
    return best


def _cover(graph):
    """The fewest rows and columns, as masks, that every entry of the sparse ``graph`` is in one of (König's theorem: from the
    rows without a mate, along a matching, all columns that are reached and all rows that are not)."""
    mate = maximum_bipartite_matching(graph, perm_type="column")
    row_of = np.full(graph.shape[1], -1)
    row_of[mate[mate >= 0]] = np.flatnonzero(mate >= 0)
    rows, columns = mate < 0, np.zeros(graph.shape[1], bool)
    front = np.flatnonzero(rows)
    while len(front):
        reached = np.unique(graph[front].indices)
        reached = reached[~columns[reached]]
        columns[reached] = True
        front = row_of[reached]  # each has a mate, or the matching would not be the largest
        rows[front] = True
    return ~rows, columns
