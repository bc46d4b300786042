# SPDX-License-Identifier: GPL-3.0-or-later
"""Folds in which a surface turns straight back on itself are opened until its two sides can be told apart.

Where lips or lids end in a corner the surface of one runs into that of the other at no angle at all; what draws or
measures such a mesh takes its triangles for turned over.
"""

import numpy as np

OPEN = np.radians(142.0)  # the most two neighbouring normals may differ
FAR = 0.8  # mm that a vertex may move


def sides(triangles):
    """Triangles on both sides of each inner edge (k, 2), the edge (k, 2), and the corner of each across it (k, 2)."""
    t = np.asarray(triangles, dtype=np.int64)
    edge = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1)
    apex = np.concatenate([t[:, 2], t[:, 0], t[:, 1]])
    owner = np.tile(np.arange(len(t)), 3)
    code = edge[:, 0] * (t.max() + 1) + edge[:, 1]
    order = np.argsort(code, kind="stable")
    same = np.flatnonzero(code[order][1:] == code[order][:-1])
    one, two = order[same], order[same + 1]
    return np.stack([owner[one], owner[two]], axis=1), edge[one], np.stack([apex[one], apex[two]], axis=1)


def unfolded(vertices, triangles, rounds: int = 60):
    """Vertices (n, 3) mm of the mesh with ``triangles`` (m, 3), moved a little where it is folded more than `OPEN`."""
    pair, edge, apex = sides(triangles)
    out = np.array(vertices, dtype=float)
    for _ in range(rounds):
        corners = out[triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        bend = np.einsum("ij,ij->i", normal[pair[:, 0]], normal[pair[:, 1]])
        folds = np.flatnonzero(bend < np.cos(OPEN))
        if len(folds) == 0:
            break
        excess = np.arccos(np.clip(bend[folds], -1, 1)) - OPEN + np.radians(1)
        start = out[edge[folds, 0]]
        along = out[edge[folds, 1]] - start
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
        # In a slit each side's outside looks at the other, in a blade away from it: one is opened, one is thickened.
        within = np.einsum("ij,ij->i", normal[pair[folds, 0]], out[apex[folds, 1]] - start)
        within += np.einsum("ij,ij->i", normal[pair[folds, 1]], out[apex[folds, 0]] - start)
        sign = np.where(within > 0, -1.0, 1.0)
        move, count = np.zeros_like(out), np.zeros(len(out))
        for k in (0, 1):
            point = apex[folds, k]
            arm = out[point] - start
            height = np.linalg.norm(arm - np.einsum("ij,ij->i", arm, along)[:, None] * along, axis=1)
            step = sign * height * np.tan(np.minimum(excess, 0.6) / 2)
            np.add.at(move, point, step[:, None] * normal[pair[folds, k]])
            np.add.at(count, point, 1)
        out += move / np.maximum(count, 1)[:, None]
        off = out - vertices
        far = np.linalg.norm(off, axis=1, keepdims=True)
        out = vertices + off * np.minimum(1, FAR / np.maximum(far, 1e-12))
    return out
