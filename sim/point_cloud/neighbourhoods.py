# SPDX-License-Identifier: GPL-3.0-or-later
"""How closely the points of a cloud lie, which planes they lie in, and which of them are specks."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

#: Points that are looked at together: bounds the memory.
BATCH = 100_000
#: Nearest points, the point itself with them, that tell how closely they lie: so few that a small patch tells it as well.
CLOSE = 6
#: Points are a speck if fewer than `SPECK` hang together, no farther than `FAR` spacings from each other.
SPECK = 30
FAR = 3.0
#: Most steps of a disc: bounds the memory where a few points lie far apart.
WIDEST = 12


def batches(count: int) -> list[slice]:
    """``count`` rows in slices of no more than `BATCH`."""
    return [slice(start, min(start + BATCH, count)) for start in range(0, count, BATCH)]


def nearest(points: np.ndarray, count: int, of: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Distances (m, count) and indices of those of ``points`` (n, 3) that are nearest to ``of`` (m, 3), or to each of them."""
    return cKDTree(points).query(points if of is None else of, k=count, workers=-1)


def spacing(distance: np.ndarray) -> np.ndarray:
    """(n,) how far apart points lie whose nearest are ``distance`` (n, k) away, if in squares on a surface."""
    return distance[:, CLOSE - 1] * np.sqrt(np.pi / CLOSE)


def planes(points: np.ndarray, near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals (n, 3), of either sign, of planes through the ``near`` (n, k) indices of ``points``; and how far (n,) those
    lie off them, root mean square."""
    normals, off = np.empty((len(near), 3)), np.empty(len(near))
    for rows in batches(len(near)):
        around = points[near[rows]]
        around = around - around.mean(axis=1, keepdims=True)
        values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around) / near.shape[1])
        normals[rows], off[rows] = vectors[:, :, 0], np.sqrt(np.maximum(values[:, 0], 0))
    return normals, off


def specks(apart: np.ndarray, distance: np.ndarray, near: np.ndarray) -> np.ndarray:
    """(n,) bool: points that hang together with fewer than `SPECK` others, in the air or on nothing that is seen.

    Of those ``near`` (n, k) each, ``distance`` (n, k) away, those hang together that are no farther than `FAR` times as far
    apart as points lie about either, ``apart`` (n,).
    """
    piece = pieces(near, distance < FAR * np.minimum(apart[:, None], apart[near]))
    return np.bincount(piece)[piece] < SPECK


def pieces(near: np.ndarray, linked: np.ndarray) -> np.ndarray:
    """(n,) the piece that each point is of, if points hang together with those ``near`` (n, k) that are ``linked`` (n, k)."""
    one, other = np.nonzero(linked)[0], near[linked]
    graph = coo_matrix((np.ones(len(one), np.int8), (one, other)), shape=(len(near),) * 2)
    return connected_components(graph, directed=False)[1]


def discs(points: np.ndarray, normals: np.ndarray, radius: np.ndarray, step: float) -> np.ndarray:
    """``points`` (n, 3), and more of them, no more than ``step`` apart on discs of ``radius`` (n,), and no more than
    `WIDEST` steps, about those."""
    rings = np.minimum(np.ceil(radius / step), WIDEST).astype(np.int64)
    found = [points]
    for count in np.unique(rings[rings > 1]):
        some = rings == count
        u, v = across(normals[some])
        x, y = np.stack(np.meshgrid(*[np.arange(-count, count + 1)] * 2), axis=-1).reshape(-1, 2).T * step
        inside = x * x + y * y <= (count * step) ** 2
        found += [points[some] + a * u + b * v for a, b in zip(x[inside], y[inside], strict=True)]
    return np.concatenate(found)


def across(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors (n, 3) at right angles to unit ``normals`` (n, 3) and each other."""
    u = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u, np.cross(normals, u)
