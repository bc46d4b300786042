# SPDX-License-Identifier: GPL-3.0-or-later
"""Catmull-Clark subdivision as sparse matrices: made once per connectivity, applied to whatever sits on vertices.

Catmull and Clark 1978 with the cubic B-spline rule along boundaries; limit positions after Halstead, Kass and DeRose
1993, section 3.
"""

from functools import lru_cache

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags, vstack

from .mesh import edges


def subdivision(faces: np.ndarray, vertex_count: int, levels: int = 1) -> tuple[csr_matrix, np.ndarray, np.ndarray]:
    """The operator (k, vertex_count), the finer quads (q, 4) int32 and the coarse face (q,) each came from.

    The first ``vertex_count`` rows are the images of the coarse vertices. ``faces`` (m, 4): a triangle has -1 last.
    """
    operator = diags(np.ones(vertex_count)).tocsr()
    parent = np.arange(len(faces))
    for _ in range(levels):
        step, faces, of = _step(np.asarray(faces), operator.shape[0])
        operator, parent = (step @ operator).tocsr(), parent[of]
    return operator, np.asarray(faces, dtype=np.int32), parent


def limit(quads: np.ndarray, vertex_count: int) -> csr_matrix:
    """The operator (n, n) that moves the vertices of a subdivided mesh (all quads) onto the limit surface."""
    quads = np.asarray(quads)
    pairs, boundary, sides = _edges_of(quads)
    n = vertex_count
    inner = ~_touched(boundary, n)
    valence = np.bincount(pairs.ravel(), minlength=n).astype(float)
    weight = np.where(inner & (valence > 0), 1 / np.maximum(valence * (valence + 5), 1), 0)
    neighbours = _symmetric(pairs, np.ones(len(pairs)), n)
    corners = quads.ravel()
    opposite = quads[:, [2, 3, 0, 1]].ravel()
    diagonal = coo_matrix((np.ones(len(corners)), (corners, opposite)), shape=(n, n)).tocsr()
    along = _symmetric(boundary, np.ones(len(boundary)), n)
    curve = np.bincount(boundary.ravel(), minlength=n) == 2
    own = np.where(inner, valence**2 * weight, np.where(curve, 4 / 6, 1))
    own[valence == 0] = 1
    return (diags(own) + diags(weight) @ (4 * neighbours + diagonal) + diags(curve / 6) @ along).tocsr()


def smoother(faces: np.ndarray, vertex_count: int, levels: int = 1) -> tuple[csr_matrix, np.ndarray]:
    """The operator (k, vertex_count) onto points of the limit surface, the coarse vertices' own first, and its quads.

    Kept for the faces last asked for.
    """
    faces = np.ascontiguousarray(faces, dtype=np.int32)
    return _smoother(faces.tobytes(), faces.shape, vertex_count, levels)


def drawn(faces: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """(n, 3) where the vertices of a cage come to lie on the surface that is drawn of it."""
    return smoother(faces, len(vertices))[0][: len(vertices)] @ vertices


def undrawn(faces: np.ndarray, vertices: np.ndarray, points: np.ndarray, rounds: int = 4) -> np.ndarray:
    """(n, 3) a cage near ``vertices`` (n, 3) whose drawn surface passes through ``points`` (n, 3), one for each vertex.

    Each round moves the cage by what is left; a few rounds leave alone what is rougher than the mesh can show.
    """
    cage = np.array(vertices, dtype=float)
    for _ in range(rounds):
        cage += points - drawn(faces, cage)
    return cage


@lru_cache(maxsize=6)
def _smoother(faces: bytes, shape, count: int, levels: int):
    operator, quads, _ = subdivision(np.frombuffer(faces, dtype=np.int32).reshape(shape), count, levels)
    return (limit(quads, operator.shape[0]) @ operator).tocsr(), quads


def _step(faces, n):
    if faces.shape[1] == 3:
        faces = np.column_stack([faces, np.full(len(faces), -1)])
    m = len(faces)
    real = faces >= 0
    size = real.sum(axis=1)
    face_of = np.repeat(np.arange(m), size)
    corner = faces[real]
    centre = coo_matrix((1 / size[face_of], (face_of, corner)), shape=(m, n)).tocsr()

    pairs, boundary, sides = _edges_of(faces)
    e = len(pairs)
    crossing = np.bincount(sides.ravel(), minlength=e)  # faces at each edge
    inner_edge = crossing == 2
    half = coo_matrix((np.full(2 * e, 0.5), (np.repeat(np.arange(e), 2), pairs.ravel())), shape=(e, n)).tocsr()
    beside = coo_matrix((np.full(len(sides), 0.5), (sides, face_of)), shape=(e, m)).tocsr()
    edge_points = diags(np.where(inner_edge, 0.5, 1.0)) @ half + diags(np.where(inner_edge, 0.5, 0.0)) @ beside @ centre

    inner = ~_touched(boundary, n)
    valence = np.bincount(pairs.ravel(), minlength=n).astype(float)
    safe = np.maximum(valence, 1)
    around = coo_matrix((np.ones(len(corner)), (corner, face_of)), shape=(n, m)).tocsr()
    neighbours = _symmetric(pairs, np.ones(e), n)
    # (Q + 2 R + (v - 3) S) / v with Q the mean of face points and R the mean of edge midpoints
    smooth = diags(inner / safe**2) @ (around @ centre + neighbours) + diags(np.where(inner, (safe - 2) / safe, 0))
    curve = np.bincount(boundary.ravel(), minlength=n) == 2
    along = _symmetric(boundary, np.full(len(boundary), 1 / 8), n)
    fixed = ~inner & ~curve | (valence == 0)
    rim = diags(curve.astype(float)) @ along + diags(np.where(curve, 3 / 4, np.where(fixed, 1.0, 0.0)))
    vertex_points = diags((~fixed & inner).astype(float)) @ smooth + rim

    # one quad per corner: the corner, the edge after it, the face, the edge before it
    start = np.cumsum(size) - size
    place = np.arange(len(corner)) - start[face_of]
    before = start[face_of] + (place - 1) % size[face_of]
    quads = np.stack([corner, n + sides, n + e + face_of, n + sides[before]], axis=1)
    return vstack([vertex_points, edge_points, centre]).tocsr(), quads.astype(np.int32), face_of


def _edges_of(faces):
    """Unique edges (e, 2), those with one face (b, 2), and per corner the edge from it to the next corner."""
    real = faces >= 0
    size = real.sum(axis=1)
    corner = faces[real].astype(np.int64)
    start = np.repeat(np.cumsum(size) - size, size)
    place = np.arange(len(corner)) - start
    following = corner[start + (place + 1) % np.repeat(size, size)]
    pairs = edges(faces).astype(np.int64)
    span = int(max(corner.max(), 0)) + 1
    key = np.minimum(corner, following) * span + np.maximum(corner, following)
    known = pairs[:, 0] * span + pairs[:, 1]
    sides = np.searchsorted(known, key)
    boundary = pairs[np.bincount(sides, minlength=len(pairs)) != 2]
    return pairs, boundary, sides


def _touched(pairs, n):
    out = np.zeros(n, dtype=bool)
    out[pairs.ravel()] = True
    return out


def _symmetric(pairs, values, n):
    rows, cols = np.concatenate([pairs, pairs[:, ::-1]]).T if len(pairs) else (np.zeros(0, int), np.zeros(0, int))
    return coo_matrix((np.tile(values, 2), (rows, cols)), shape=(n, n)).tocsr()
