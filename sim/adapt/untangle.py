# SPDX-License-Identifier: GPL-3.0-or-later
"""No triangle of the fitted skin may pierce another: where some do, the reference's own shape is restored there.

The reference pierces itself nowhere. Around a tangle the displacement from it is replaced by the smoothest one that
fits the surroundings, in a patch that grows until the tangle is gone.
"""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..mesh import edges
from .smooth_system import factorised, laplacian
from .thin_plate_spline import similarity

FOLD = np.cos(np.radians(150))  # neighbouring triangles that turn back on each other more sharply than this are a fold
MOST = 5.0  # mm that untangling may move what is seen


def pierced(vertices, triangles, among=None):
    """Pairs (k,), (k,) of triangles without a common vertex of which one pierces the other.

    ``among`` : (t,) bool, at least one of each pair is one of these (None: all are looked at).
    """
    corners = vertices[triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    middle, half = (low + high) / 2, (high - low).max(axis=1) / 2
    # Broad phase by size classes, so that a few large triangles do not make everybody's ball large.
    order = np.argsort(half, kind="stable")
    found = []
    ask = np.arange(len(half)) if among is None else np.flatnonzero(among)
    for part in np.array_split(order, 8):
        if len(part) == 0 or len(ask) == 0:
            continue
        tree, reach = cKDTree(middle[part]), half[part].max()
        near = tree.query_ball_point(middle[ask], half[ask] + reach, p=np.inf, return_sorted=False)
        size = np.fromiter(map(len, near), dtype=np.int64, count=len(near))
        if size.sum() == 0:
            continue
        a = np.repeat(ask, size)
        b = part[np.concatenate([np.asarray(x, dtype=np.int64) for x in near if x])]
        keep = (low[a] <= high[b]).all(axis=1) & (low[b] <= high[a]).all(axis=1)
        found.append(np.stack([a[keep], b[keep]], axis=1))
    if not found:
        return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
    pair = np.unique(np.sort(np.concatenate(found), axis=1), axis=0)
    first, second = pair[pair[:, 0] != pair[:, 1]].T
    apart = (triangles[first][:, :, None] != triangles[second][:, None]).all(axis=(1, 2))
    first, second = first[apart], second[apart]
    hit = _sides_through(corners[first], corners[second]) | _sides_through(corners[second], corners[first])
    return first[hit], second[hit]


def _sides_through(a, b):
    """(k,) bool: does a side of triangle ``a`` (k, 3, 3) pass through the inside of triangle ``b``?"""
    out = np.zeros(len(a), dtype=bool)
    u, v = b[:, 1] - b[:, 0], b[:, 2] - b[:, 0]
    normal = np.cross(u, v)
    height = np.einsum("kij,kj->ki", a - b[:, :1], normal)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        rows = np.flatnonzero(height[:, i] * height[:, j] < 0)
        if len(rows) == 0:
            continue
        h0, h1 = height[rows, i], height[rows, j]
        t = (h0 / (h0 - h1))[:, None]
        w = (1 - t) * a[rows, i] + t * a[rows, j] - b[rows, 0]
        n2 = np.maximum(np.einsum("ij,ij->i", normal[rows], normal[rows]), 1e-30)
        p = np.einsum("ij,ij->i", np.cross(w, v[rows]), normal[rows]) / n2
        q = np.einsum("ij,ij->i", np.cross(u[rows], w), normal[rows]) / n2
        out[rows[(p > 0) & (q > 0) & (p + q < 1)]] = True
    return out


def sharp(vertices, triangles):
    """(s, 2) pairs of neighbouring triangles that turn back on each other by more than 150 degrees."""
    t = triangles.astype(np.int64)
    side = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1)
    code = side[:, 0] * (t.max() + 1) + side[:, 1]
    owner = np.tile(np.arange(len(t)), 3)
    order = np.argsort(code, kind="stable")
    same = np.flatnonzero(code[order][1:] == code[order][:-1])
    pair = np.stack([owner[order[same]], owner[order[same + 1]]], axis=1)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return pair[np.einsum("ij,ij->i", normal[pair[:, 0]], normal[pair[:, 1]]) < FOLD]


def tangled(vertices, triangles, allowed=frozenset(), among=None):
    """(n,) bool: vertices of triangles that pierce others, or fold back where the reference does not."""
    out = np.zeros(len(vertices), dtype=bool)
    first, second = pierced(vertices, triangles, among)
    out[triangles[np.concatenate([first, second])].ravel()] = True
    fold = [p for p in map(tuple, sharp(vertices, triangles).tolist()) if p not in allowed]
    if fold:
        out[triangles[np.unique(np.array(fold))].ravel()] = True
    return out


def untangled(reference, vertices, faces, triangles, visible, hold=None, rounds: int = 6):
    """The vertices (n, 3) with tangles smoothed away.

    Parameters
    ----------
    reference : (n, 3) mm, the same mesh without tangles
    visible : (n,) bool, vertices that make the likeness
    hold : (n,) bool, vertices that must stay (None: none)
    """
    out = np.array(vertices, dtype=float)
    n = len(out)
    allowed = frozenset(map(tuple, sharp(reference, triangles).tolist()))
    energy, link = _matrices(reference, faces)
    patch = np.zeros(n, dtype=bool)
    best, fewest, among = out, None, None
    for turn in range(rounds):
        wrong = tangled(out, triangles, allowed, among)
        if hold is not None:
            wrong &= ~hold
        if fewest is None or wrong.sum() < fewest:
            best, fewest = out.copy(), wrong.sum()
        if not wrong.any():
            break
        grown = wrong
        for _ in range(1 + turn // 2):
            grown = grown | (link @ grown.astype(float) > 0)
        patch |= grown
        if hold is not None:
            patch &= ~hold
        among = patch[triangles].any(axis=1)
        out = np.array(vertices, dtype=float)
        _fill_all(reference, out, energy, link, patch)
    # A patch that would change the likeness more than its tangle does, stays as it was.
    moved = np.linalg.norm(best - vertices, axis=1)
    _, label = connected_components(link[moved > 0][:, moved > 0], directed=False)
    rows = np.flatnonzero(moved > 0)
    for k in range(label.max() + 1 if len(rows) else 0):
        part = rows[label == k]
        if moved[part][visible[part]].max(initial=0) > MOST:
            best[part] = vertices[part]
    return best


def restored(reference, vertices, faces, patch, scale=None):
    """Vertices (n, 3) with the reference's own shape where ``patch`` (n,) bool, fitted to what surrounds it.

    ``scale`` : size of the head relative to the reference, if the patch is to have that and not its surroundings' own.
    """
    out = np.array(vertices, dtype=float)
    if patch.any():
        _fill_all(reference, out, *_matrices(reference, faces), patch, scale)
    return out


def _matrices(reference, faces):
    bend = laplacian(reference, faces)
    n = len(reference)
    a, b = edges(faces).T
    link = coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(n, n)).tocsr()
    return (bend.T @ bend).tocsr(), link


def _fill_all(reference, out, energy, link, patch, scale=None):
    _, label = connected_components(link[patch][:, patch], directed=False)
    rows = np.flatnonzero(patch)
    for k in range(label.max() + 1):
        _fill(reference, out, energy, link, rows[label == k], scale)


def _fill(reference, out, energy, link, rows, scale):
    """Replace the vertices ``rows`` of ``out`` by the smoothest continuation of what surrounds them."""
    near = np.zeros(len(out), dtype=bool)
    near[rows] = True
    inside = near.copy()
    for _ in range(3):
        near |= link @ near.astype(float) > 0
    ring = np.flatnonzero(near & ~inside)
    matrix, shift = similarity(reference[ring], out[ring])
    if scale is not None:
        smaller = matrix * (scale / np.cbrt(np.linalg.det(matrix)))
        shift = shift + (matrix - smaller) @ reference[ring].mean(axis=0)
        matrix = smaller
    base = reference @ matrix.T + shift
    right = -(energy[rows][:, ring] @ (out - base)[ring])
    out[rows] = base[rows] + factorised(energy[rows][:, rows])(right)
