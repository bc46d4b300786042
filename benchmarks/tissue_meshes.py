# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference head with a finer or coarser skin: subdivided (Catmull and Clark 1978), then thinned evenly.

Thinning collapses edges onto one of their ends, the one first that is shortest beside the edges around it: so every place
is thinned alike, lips and lids keep their finer mesh, and what stands on vertices (groups, landmarks) stays what it was.
"""

import heapq
from dataclasses import replace

import numpy as np

from headshop.sim.anatomy.head import Head, SurfacePoints
from headshop.sim.mesh import Mesh
from headshop.sim.mesh_subdivision import subdivision
from headshop.sim.tissue.geometry import short_diagonals


def resized(head: Head, times: float) -> Head:
    """``head`` with about ``times`` as many skin vertices."""
    skin, groups = head.skin, head.groups
    count = round(times * len(skin.vertices))
    vertices, faces = skin.vertices, skin.faces
    if times == 1:
        return head
    while len(vertices) < count:
        operator, faces, _ = subdivision(faces, len(vertices))
        vertices = operator @ vertices
        groups = {name: (operator @ np.asarray(w, float)).astype(np.float32) for name, w in groups.items()}
    if len(vertices) > count:
        triangles, kept = thinned(vertices, short_diagonals(vertices, faces), count)
        vertices = vertices[kept]
        groups = {name: np.asarray(w)[kept] for name, w in groups.items()}
        faces = np.concatenate([triangles, np.full((len(triangles), 1), -1)], axis=1)
    marks = head.landmark_positions()
    nearest = np.array([np.argmin(((vertices - marks[name]) ** 2).sum(axis=1)) for name in head.landmarks.names])
    corners = np.repeat(nearest[:, None], 3, axis=1).astype(np.int32)
    landmarks = SurfacePoints(
        head.landmarks.names, head.landmarks.part, corners, np.tile([1.0, 0, 0], (len(corners), 1))
    )
    parts = {**head.parts, "skin": Mesh(vertices, faces.astype(np.int32))}
    return replace(head, parts=parts, groups=groups, landmarks=landmarks)


def thinned(vertices: np.ndarray, triangles: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (t, 3) over the ``count`` vertices that are left, and which (count,) they are."""
    around = [set() for _ in vertices]
    faces = {k: tuple(face) for k, face in enumerate(triangles.tolist())}
    at = [set() for _ in vertices]
    for k, (a, b, c) in faces.items():
        for own, others in ((a, (b, c)), (b, (a, c)), (c, (a, b))):
            around[own].update(others)
            at[own].add(k)
    points = vertices.tolist()
    length = {(a, b): _distance(points[a], points[b]) for a in range(len(points)) for b in around[a] if a < b}
    usual = np.array(
        [np.mean([length[min(a, b), max(a, b)] for b in near]) if near else 1.0 for a, near in enumerate(around)]
    )
    heap = [(far / (usual[a] + usual[b]), a, b) for (a, b), far in length.items()]
    heapq.heapify(heap)
    border = {v for (a, b) in length if len(at[a] & at[b]) != 2 for v in (a, b)}
    alive = [bool(near) for near in around]
    left = len(points)
    while left > count and heap:
        _, gone, kept = heapq.heappop(heap)
        if not (alive[gone] and alive[kept]) or kept not in around[gone]:
            continue
        if gone in border:
            gone, kept = kept, gone
        if gone in border or len(around[gone] & around[kept]) != 2 or _turns(points, faces, at, gone, kept):
            continue
        for k in list(at[gone]):
            face = faces[k]
            for v in face:
                at[v].discard(k)
            if kept in face:
                del faces[k]
                continue
            faces[k] = tuple(kept if v == gone else v for v in face)
            for v in faces[k]:
                at[v].add(k)
        for v in around[gone]:
            around[v].discard(gone)
            if v != kept:
                around[v].add(kept)
                around[kept].add(v)
        around[gone] = set()
        alive[gone] = False
        left -= 1
        for v in around[kept]:
            heapq.heappush(heap, (_distance(points[v], points[kept]) / (usual[v] + usual[kept]), kept, v))
    keep = np.array([k for k, here in enumerate(alive) if here or not at[k]])
    keep = keep[[bool(at[k]) for k in keep]]
    number = np.full(len(points), -1)
    number[keep] = np.arange(len(keep))
    return number[np.array(list(faces.values()))], keep


def _distance(p, q) -> float:
    return sum((x - y) ** 2 for x, y in zip(p, q, strict=True)) ** 0.5


def _turns(points, faces, at, gone, kept) -> bool:
    """Whether a face around ``gone`` would turn by more than about 60 degrees, or vanish, if it went to ``kept``."""
    for k in at[gone]:
        face = faces[k]
        if kept in face:
            continue
        before = _normal([points[v] for v in face])
        after = _normal([points[kept if v == gone else v] for v in face])
        size = (sum(x * x for x in before) * sum(x * x for x in after)) ** 0.5
        if sum(x * y for x, y in zip(before, after, strict=True)) < 0.5 * size or size == 0:
            return True
    return False


def _normal(corners):
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners
    ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
