# SPDX-License-Identifier: GPL-3.0-or-later
"""No triangle of the fitted skin may pierce another: where some do, the reference's own shape is restored there.

The reference pierces itself nowhere. Around a tangle the displacement from it is replaced by the smoothest one that
fits the surroundings, in a patch that grows until the tangle is gone.
"""

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import diags
from scipy.sparse.csgraph import connected_components

from ..mesh_piercing import self_piercings
from ..mesh_subdivision import drawn
from ..progress import Progress, Work, finish
from .smooth_system import factorised
from .thin_plate_spline import similarity

if TYPE_CHECKING:
    from .rest import Rest

FOLD = np.cos(np.radians(150))  # neighbouring triangles that turn back on each other more sharply than this are a fold
MOST = 5.0  # mm that untangling may move what is seen
WHOLE = 3.0  # pull, against bending, on what stays in one piece


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
    out[triangles[self_piercings(vertices, triangles, among).ravel()].ravel()] = True
    fold = [p for p in map(tuple, sharp(vertices, triangles).tolist()) if p not in allowed]
    if fold:
        out[triangles[np.unique(np.array(fold))].ravel()] = True
    return out


def untangled(rest: "Rest", vertices, visible, hold=None, rounds: int = 6):
    """`untangling`, at once."""
    return finish(untangling(rest, vertices, visible, hold, rounds))


def untangling(rest: "Rest", vertices, visible, hold=None, rounds: int = 6) -> Work:
    """Work returning the vertices (n, 3) with tangles smoothed away, of the surface drawn, and of its cage where that is
    not seen.

    Parameters
    ----------
    rest : the reference, without tangles
    visible : (n,) bool, vertices that make the likeness
    hold : (n,) bool, vertices that must stay (None: none)
    """
    triangles, link = rest.head.skin.triangles, rest.link
    out = np.array(vertices, dtype=float)
    patch = np.zeros(len(out), dtype=bool)
    hidden = ~visible[triangles].all(axis=1)
    best, fewest, among = out, None, None
    for turn in range(rounds):
        yield Progress(turn / rounds, "Untangle the skin")
        wrong = tangled(drawn(rest.head.skin.faces, out), triangles, rest.folds, among)
        yield Progress((turn + 0.4) / rounds, "Untangle the skin")
        pairs = self_piercings(out, triangles, among)
        wrong[triangles[pairs[hidden[pairs].all(axis=1)].ravel()].ravel()] = True
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
        yield Progress((turn + 0.8) / rounds, "Untangle the skin")
        out = np.array(vertices, dtype=float)
        _fill_all(rest, out, patch)
    # A patch that would change the likeness more than its tangle does, stays as it was.
    moved = np.linalg.norm(best - vertices, axis=1)
    _, label = connected_components(link[moved > 0][:, moved > 0], directed=False)
    rows = np.flatnonzero(moved > 0)
    for k in range(label.max() + 1 if len(rows) else 0):
        part = rows[label == k]
        if moved[part][visible[part]].max(initial=0) > MOST:
            best[part] = vertices[part]
    return best


def restored(rest: "Rest", vertices, patch, scale=None, whole=None):
    """Vertices (n, 3) with the reference's own shape where ``patch`` (n,) bool, fitted to what surrounds it.

    Parameters
    ----------
    scale : size of the head relative to the reference, if the patch is to have that and not its surroundings' own
    whole : (n,) 0..1, what of the patch stays in one piece (None: nothing): it turns as the surroundings do in the mean
        and keeps its root on them. An ear hangs on a narrow strip; what bends that would crumple all of it.
    """
    out = np.array(vertices, dtype=float)
    if patch.any():
        _fill_all(rest, out, patch, scale, whole)
    return out


def _fill_all(rest, out, patch, scale=None, whole=None):
    _, label = connected_components(rest.link[patch][:, patch], directed=False)
    rows = np.flatnonzero(patch)
    for k in range(label.max() + 1):
        _fill(rest, out, rows[label == k], scale, whole)


def _fill(rest, out, rows, scale, whole):
    """Replace the vertices ``rows`` of ``out`` by the smoothest continuation of what surrounds them."""
    reference, energy = rest.head.skin.vertices, rest.energy
    near = np.zeros(len(out), dtype=bool)
    near[rows] = True
    inside = near.copy()
    for _ in range(3):
        near |= rest.link @ near.astype(float) > 0
    ring = np.flatnonzero(near & ~inside)
    matrix, shift = similarity(reference[ring], out[ring])
    if scale is not None:
        smaller = matrix * (scale / np.cbrt(np.linalg.det(matrix)))
        shift = shift + (matrix - smaller) @ reference[ring].mean(axis=0)
        matrix = smaller
    base = reference @ matrix.T + shift
    bending, right = energy[rows][:, rows], -(energy[rows][:, ring] @ (out - base)[ring])
    move = factorised(bending)(right)
    piece = np.zeros(len(out)) if whole is None else np.where(inside, whole, 0.0)
    root = ((piece > 0.5) & (rest.link @ (piece <= 0.5).astype(float) > 0))[rows]
    if root.any():
        pull = WHOLE * piece[rows][:, None]
        move = factorised(bending + diags(pull.ravel()))(right + pull * move[root].mean(axis=0))
    out[rows] = base[rows] + move
