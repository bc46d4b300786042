# SPDX-License-Identifier: GPL-3.0-or-later
"""Texture coordinates of the reference skin: one large island cut open at the back, small ones for what lies inside.

Every island is flattened with mean value coordinates (Floater 2003) onto a convex outline, so nothing overlaps.
"""

import numpy as np
from scipy.sparse import coo_matrix, identity
from scipy.sparse.linalg import spsolve

from .skin_layout import HALF, Layout


def _mean_value(vertices, triangles, fixed, where):
    """(n, 2) positions: mean value weights, ``fixed`` vertices at ``where``."""
    rows, cols, values = [], [], []
    for k in range(3):
        i, j, m = triangles[:, k], triangles[:, (k + 1) % 3], triangles[:, (k + 2) % 3]
        a, b = vertices[j] - vertices[i], vertices[m] - vertices[i]
        la, lb = np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)
        cosine = np.clip((a * b).sum(1) / np.maximum(la * lb, 1e-9), -0.999, 0.9999)
        half = np.sqrt((1 - cosine) / (1 + cosine))
        rows += [i, i]
        cols += [j, m]
        values += [half / np.maximum(la, 0.2), half / np.maximum(lb, 0.2)]
    n = len(vertices)
    weight = coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(cols))), shape=(n, n)).tocsr()
    total = np.asarray(weight.sum(axis=1)).ravel()
    system = identity(n, format="csr") - coo_matrix((1 / np.maximum(total, 1e-12), (range(n), range(n)))) @ weight
    known = np.zeros(n, dtype=bool)
    known[fixed] = True
    used = np.zeros(n, dtype=bool)
    used[triangles] = True
    out = np.zeros((n, 2))
    out[fixed] = where
    free = np.flatnonzero(used & ~known)
    out[free] = spsolve(system[free][:, free].tocsc(), -system[free][:, known] @ out[known])
    return out


def _split(quads):
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _disc(vertices, quads, rim, centre, radius):
    """UV of a closed cup: its rim on a circle, first rim vertices on the right."""
    angle = np.linspace(0, 2 * np.pi, len(rim), endpoint=False)
    ring = np.asarray(centre) + np.asarray(radius) * np.stack([np.cos(angle), np.sin(angle)], 1)
    return _mean_value(vertices, _split(quads), rim, ring)


def skin_uv(layout: Layout, vertices: np.ndarray) -> np.ndarray:
    """(m, 4, 2) float32 per face corner, 0..1; the two sides are mirror images about u = 0.5."""
    faces = layout.faces
    uv = np.full((len(faces), 4, 2), np.nan)
    cups = {"mouth": 7, "eye_l": 6, "eye_r": 6, "nostril_l": 1, "nostril_r": 1}
    cup_of = np.full(layout.count, "", dtype=object)
    for hole, first in cups.items():
        cup_of[layout.rings[hole][first + 1 :]] = hole
        cup_of[layout.patches[hole]] = hole
    hole_of_face = np.array([next((h for h in cup_of[f] if h), "") for f in faces])
    outer = np.flatnonzero(hole_of_face == "")

    # the outer island: left half flattened with the front midline on a straight line, then mirrored
    left = outer[(layout.mirror[faces[outer]] >= faces[outer]).all(axis=1)]
    middle = layout.crown.shape[1] // 2
    seam_top = layout.crown[:, middle]  # front to back over the crown
    front = np.r_[seam_top[middle::-1], layout.grid[1:16, 0], layout.rings["mouth"][1:8, 27]]
    below = np.r_[layout.rings["mouth"][7:0:-1, 11], layout.grid[22:, 0]]
    neck = layout.grid[-1, 0 : HALF + 1]
    back = np.r_[layout.grid[:0:-1, HALF], seam_top[:middle:-1]]

    def spread(line, start, end):
        step = np.linalg.norm(np.diff(vertices[line], axis=0), axis=1)
        t = np.r_[0, np.cumsum(step)] / step.sum()
        return np.asarray(start) + t[:, None] * (np.asarray(end) - start)

    total = [np.linalg.norm(np.diff(vertices[line], axis=0), axis=1).sum() for line in (front, below)]
    height = 0.96
    cut = 0.98 - height * total[0] / sum(total)
    outline = {}
    for line, points in (
        (front, spread(front, (0.5, 0.98), (0.5, cut))),
        (below, spread(below, (0.5, cut), (0.5, 0.98 - height))),
        (neck, spread(neck, (0.5, 0.98 - height), (0.96, 0.98 - height))),
        (back, spread(back, (0.96, 0.98 - height), (0.96, 0.98))),
    ):
        outline.update(zip(line.tolist(), points.tolist(), strict=True))
    crown_end = spread(np.r_[back[-1], seam_top[middle]], (0.96, 0.98), (0.5, 0.98))
    outline.setdefault(int(back[-1]), crown_end[0].tolist())
    triangles = _split(faces[left])
    rims = {}
    extra = [vertices]
    for hole in ("mouth", "eye_l", "nostril_l"):  # a fan over each opening keeps it convex enough to flatten
        ring = layout.rings[hole][cups[hole]]
        if hole == "mouth":
            continue
        rims[hole] = ring
        tip = layout.count + len(extra) - 1
        extra.append(vertices[ring].mean(0, keepdims=True))
        triangles = np.concatenate([triangles, np.stack([ring, np.roll(ring, -1), np.full(len(ring), tip)], 1)])
    ring = layout.rings["mouth"][cups["mouth"]]
    half = ring[11:28]
    tip = layout.count + len(extra) - 1
    extra.append(vertices[half].mean(0, keepdims=True))
    triangles = np.concatenate([triangles, np.stack([half[:-1], half[1:], np.full(len(half) - 1, tip)], 1)])
    triangles = np.concatenate([triangles, [[half[-1], half[0], tip]]])
    points = np.concatenate(extra)
    flat = _mean_value(points, triangles, np.array(list(outline)), np.array(list(outline.values())))
    uv[left] = flat[faces[left]]

    # cups as discs in the free strips left and right of the neck are small: they sit in the lower margin corners
    for hole, centre, radius in (
        ("eye_l", (0.985, 0.90), (0.013, 0.05)),
        ("nostril_l", (0.985, 0.80), (0.010, 0.02)),
        ("mouth", (0.985, 0.60), (0.013, 0.15)),
    ):
        own = np.flatnonzero(hole_of_face == hole)
        if hole == "mouth":
            own = own[(layout.mirror[faces[own]] >= faces[own]).all(axis=1)]
            rim = layout.rings["mouth"][7, 11:28]
            angle = np.linspace(-np.pi / 2, np.pi / 2, len(rim))
            where = np.asarray((0.972, 0.60)) + np.asarray((0.025, 0.15)) * np.stack([np.cos(angle), np.sin(angle)], 1)
            chord = np.r_[
                layout.rings["mouth"][8:, 27], layout.patches["mouth"][1, 7], layout.rings["mouth"][:7:-1, 11]
            ]
            line = np.asarray((0.972, 0.60)) + np.stack(
                [np.zeros(len(chord)), np.linspace(0.15, -0.15, len(chord) + 2)[1:-1]], 1
            )
            placed = _mean_value(vertices, _split(faces[own]), np.r_[rim, chord], np.r_[where, line])
        else:
            placed = _disc(vertices, faces[own], layout.rings[hole][cups[hole]], centre, radius)
        uv[own] = placed[faces[own]]
    mirrored = len(faces) // 2  # the second half of the table mirrors the first
    order = [0, 3, 2, 1]
    uv[mirrored:] = uv[:mirrored][:, order] * [-1, 1] + [1, 0]
    return uv.astype(np.float32)
