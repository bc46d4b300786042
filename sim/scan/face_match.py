# SPDX-License-Identifier: GPL-3.0-or-later
"""Find a face in a scan by laying a reference face on it from many starts at once (Besl and McKay 1992, trimmed)."""

import numpy as np
from scipy.spatial import cKDTree

from ..anatomy.head import Head
from ..mesh import Mesh

#: Points of the template in the first and in the last rounds.
FEW, MANY = 140, 450
#: More vertices than this say no more about where the face is.
PLENTY = 200_000
#: Part of the template that must find the scan: the rest may lie over holes.
TRIM = 0.8
#: Cells along the scan's largest extent in the first and in the last rounds.
COARSE, FINE = 48, 120
#: A head may be this much smaller or larger than the reference.
SMALLEST, LARGEST = 0.72, 1.22


def surface_samples(mesh: Mesh) -> np.ndarray:
    """Vertices of the faces and, of a coarse mesh, the middles of faces and their sides (k, 3); NaN left out."""
    triangles = mesh.triangles
    triangles = triangles[np.isfinite(mesh.vertices).all(axis=1)[triangles].all(axis=1)]
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[triangles.ravel()] = True
    points = mesh.vertices[used]
    out = [points[:: 1 + len(points) // PLENTY]]
    if len(triangles) < 60_000:
        a, b, c = (mesh.vertices[triangles[:, k]] for k in range(3))
        out += [(a + b + c) / 3, (a + b) / 2, (b + c) / 2, (c + a) / 2]
    return np.concatenate(out)


def thinned(points: np.ndarray, cells: int = COARSE) -> np.ndarray:
    """One point (the mean) per occupied cell, ``cells`` along the largest extent: even density whatever the mesh."""
    low = points.min(axis=0)
    size = max(np.ptp(points, axis=0).max() / cells, 1e-12)
    cell = np.floor((points - low) / size).astype(np.int64)
    key = (cell[:, 0] * (cells + 2) + cell[:, 1]) * (cells + 2) + cell[:, 2]
    _, index, count = np.unique(key, return_inverse=True, return_counts=True)
    return np.stack([np.bincount(index.ravel(), points[:, k]) for k in range(3)], axis=1) / count[:, None]


def face_template(head: Head) -> np.ndarray:
    """(k, 3) mm, evenly spread points of the reference's face, what a scanner sees of it; the first is the nose tip."""
    skin = head.skin.vertices
    seen = (head.groups["face"] > 0.5) & (head.groups["inner"] < 0.5)
    return np.concatenate([[head.landmark_positions()["prn"]], _spread(skin[seen], MANY - 1)])


def best_turns(
    points: np.ndarray, template: np.ndarray, turns: list[np.ndarray]
) -> list[tuple[float, np.ndarray, float]]:
    """(misfit in mm, turn, size) of the best placement of the face near each of ``turns``, best first.

    points (n, 3) mm : samples of the scan's surface, in its own axes; template (k, 3) mm : +Z up, face toward -Y;
    turns : rotations (3, 3) from the scan's axes to the template's. The misfit is the trimmed mean distance, on a
    head of reference size; the size is relative to the reference's.
    """
    fine = cKDTree(thinned(points, FINE))
    points = thinned(points, COARSE)
    tree = cKDTree(points)
    few = template[in_order(template, FEW)]
    start_turn, start_shift, of = starts_of(points, template, few, turns)
    placed = align(tree, few, start_turn, start_shift, rounds=10)
    best = np.argsort(placed[-1])
    chosen = {}
    for k in best:  # the two best of each turn go on
        chosen.setdefault(of[k], []).append(k)
    go_on = np.array([k for group in chosen.values() for k in group[:2]])
    go_on = go_on[np.argsort(placed[-1][go_on])][:8]
    scale, turn, shift, misfit = align(fine, template, placed[1][go_on], placed[2][go_on], 12, placed[0][go_on])
    out = {}
    for k in np.argsort(misfit):
        # where it ended up may be nearer to another of the turns than to the one it began with
        nearest = max(range(len(turns)), key=lambda j: np.trace(turns[j] @ turn[k]))  # noqa: B023 (used at once)
        out.setdefault(nearest, (float(misfit[k]), turns[nearest], float(scale[k])))
    return sorted(out.values(), key=lambda entry: entry[0])


def starts_of(points, template, few, turns):
    """For each turn: nose tip on the foremost point; middles and fronts of the boxes together; tops and fronts."""
    rotation, shift, of = [], [], []
    crowd = cKDTree(points)
    spacing = np.median(crowd.query(points, k=2)[0][:, 1])
    solid = points[np.array([len(i) for i in crowd.query_ball_point(points, 4 * spacing)]) > 8]
    solid = points if len(solid) < 50 else solid
    for k, turn in enumerate(turns):
        p = solid @ turn.T
        low, high = np.percentile(p, 1, axis=0), np.percentile(p, 99, axis=0)
        tip, middle = p[p[:, 1].argmin()], (low + high) / 2
        face_low, face_high = few.min(axis=0), few.max(axis=0)
        face_middle = (face_low + face_high) / 2
        for target, source in (
            (tip, template[0]),
            ((middle[0], low[1], middle[2]), (face_middle[0], face_low[1], face_middle[2])),
            ((middle[0], low[1], high[2] - 40), (face_middle[0], face_low[1], face_high[2])),
        ):
            rotation.append(turn.T)
            shift.append(turn.T @ (np.asarray(target) - np.asarray(source)))
            of.append(k)
    return np.array(rotation), np.array(shift), of


def align(tree, template, turn, shift, rounds, scale=None):
    """Trimmed ICP of the template to the scan from h starts at once: scale (h,), turn (h, 3, 3), shift, misfit (h,)."""
    scale = np.ones(len(turn)) if scale is None else scale
    keep = int(TRIM * len(template))
    for step in range(rounds + 1):
        moved = scale[:, None, None] * (template @ turn.transpose(0, 2, 1)) + shift[:, None]
        distance, nearest = tree.query(moved.reshape(-1, 3), workers=-1)
        distance, nearest = distance.reshape(moved.shape[:2]), nearest.reshape(moved.shape[:2])
        inner = np.argpartition(distance, keep - 1, axis=1)[:, :keep]
        if step == rounds:
            break
        a = template[inner]
        b = tree.data[np.take_along_axis(nearest, inner, axis=1)]
        mean_a, mean_b = a.mean(axis=1, keepdims=True), b.mean(axis=1, keepdims=True)
        u, s, vt = np.linalg.svd((b - mean_b).transpose(0, 2, 1) @ (a - mean_a))
        flip = np.ones((len(turn), 3))
        flip[:, 2] = np.sign(np.linalg.det(u @ vt))
        turn = (u * flip[:, None]) @ vt
        spread = ((a - mean_a) ** 2).sum(axis=(1, 2))
        if step >= 4:  # the size only once the place is roughly right
            scale = np.clip((s * flip).sum(axis=1) / spread, SMALLEST, LARGEST)
        shift = mean_b[:, 0] - scale[:, None] * np.einsum("hij,hj->hi", turn, mean_a[:, 0])
    misfit = np.take_along_axis(distance, inner, axis=1).mean(axis=1) / scale
    return scale, turn, shift, misfit


def in_order(points, count):
    return np.unique(np.linspace(0, len(points) - 1, min(count, len(points))).astype(int))


def _spread(points, count):
    """About ``count`` of the points, evenly spread over their surface."""
    cells = 60
    while cells > 4 and len(thinned(points, cells)) > count:
        cells -= 2
    return thinned(points, cells)
