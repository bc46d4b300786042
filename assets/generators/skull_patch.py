# SPDX-License-Identifier: GPL-3.0-or-later
"""Half a bone as a patchwork: pieces cut from meshes, sewn together along their borders, and mirrored into a whole.

A half lies at x >= 0; its border on the midline, x = 0, stays open until `whole` closes it. Sewing finds the cheapest
band of quads and triangles between two borders (Fuchs, Kedem and Uselton 1977), so mirrored halves match face by face.
"""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ...sim.mesh import Mesh, vertex_normals
from .skull_nets import towards_surface

#: What a triangle costs in a seam against a quad, mm of rung.
TRIANGLE = 1.2


def left_half(mesh: Mesh) -> Mesh:
    """The faces of a symmetric mesh at x > 0, its midline vertices exactly at x = 0."""
    keep = mesh.vertices[mesh.faces, 0].mean(axis=1) > 0
    half = _compact(mesh.vertices, mesh.faces[keep])
    vertices = half.vertices.copy()
    vertices[np.abs(vertices[:, 0]) < 1e-6, 0] = 0.0
    return half.moved(vertices)


def whole(half: Mesh) -> Mesh:
    """The closed mesh of a half and its mirror image; quads are split along their better diagonal, on both sides alike."""
    faces = _well_split(half.vertices, half.faces)
    n = len(half.vertices)
    off = np.flatnonzero(half.vertices[:, 0] > 0)
    twin = np.arange(n)
    twin[off] = n + np.arange(len(off))
    vertices = np.concatenate([half.vertices, half.vertices[off] * [-1, 1, 1]])
    flip = np.where(faces[:, 3:] >= 0, faces[:, [0, 3, 2, 1]], faces[:, [0, 2, 1, 3]])
    other = np.where(flip >= 0, twin[flip], -1)
    return Mesh(vertices, np.concatenate([faces, other]).astype(np.int32))


def cut(half: Mesh, gone) -> Mesh:
    """``half`` without the largest patch of faces that touch a vertex of ``gone`` (n,) bool, its border without spikes."""
    drop = gone[half.faces].any(axis=1)
    patch = _piece(half.faces[drop])
    drop[np.flatnonzero(drop)[~patch]] = False
    faces = half.faces[~drop]
    for _ in range(20):
        faces = faces[_piece(faces)]
        a, b = _border(faces, half.vertices)
        # A vertex with more than two border edges pinches; a face with three of them is a spike.
        bad = np.flatnonzero(np.bincount(np.concatenate([a, b]), minlength=len(half.vertices)) > 2)
        code = set((np.minimum(a, b) * 10**6 + np.maximum(a, b)).tolist())
        sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2)
        key = sides.min(axis=2) * 10**6 + sides.max(axis=2)
        open_sides = np.isin(key, list(code)).sum(axis=1)
        drop = (open_sides >= 3) | np.isin(faces, bad).any(axis=1)
        if not drop.any():
            break
        faces = faces[~drop]
    chains = _chains(faces, half.vertices)
    vertices = half.vertices
    for chain in chains[1:]:  # small holes beside the great one
        middle = len(vertices)
        vertices = np.concatenate([vertices, vertices[chain].mean(axis=0, keepdims=True)])
        a, b = np.array(chain), np.roll(chain, -1)
        fan = np.stack([b, a, np.full(len(a), middle), np.full(len(a), -1)], axis=1)
        faces = np.concatenate([faces, fan])
    return _compact(vertices, faces)


def border(half: Mesh) -> np.ndarray:
    """The border of a half off the midline as one chain of vertices, the surface on its left side.

    Raises ValueError where it has none, or more than one.
    """
    chains = _chains(half.faces, half.vertices)
    if len(chains) != 1:
        raise ValueError(f"The half has {len(chains)} borders; one was wanted.")
    return np.array(chains[0])


def _chains(faces, vertices):
    """Lists of vertices along each border off the midline, the longest that starts and ends at the midline first."""
    a, b = _border(faces, vertices)
    follow = dict(zip(a.tolist(), b.tolist(), strict=True))
    starts = sorted(set(follow) - set(follow.values()))
    chains = []
    while follow:
        at = starts.pop(0) if starts else min(follow)
        chain = [at]
        while at in follow:
            at = follow.pop(at)
            if at == chain[0]:
                break
            chain.append(at)
        chains.append(chain)
    return sorted(chains, key=lambda c: (vertices[c[0], 0] != 0, -len(c)))


def sewn(first: Mesh, second: Mesh) -> tuple[Mesh, np.ndarray]:
    """Two halves joined along their borders, which run from midline to midline; and the seam's vertices."""
    a, b = border(first), border(second)[::-1]
    vertices = np.concatenate([first.vertices, second.vertices])
    shifted = np.where(second.faces >= 0, second.faces + len(first.vertices), -1)
    b = b + len(first.vertices)
    faces = _band(vertices, a, b)
    mesh = Mesh(vertices, np.concatenate([first.faces, shifted, faces]).astype(np.int32))
    return mesh, np.concatenate([a, b])


def evened(half: Mesh, field, seam, cell: float, fixed, rounds: int = 8) -> Mesh:
    """``half`` with the surroundings of a seam evened out along the surface of ``field``.

    seam : vertices; fixed (n,) bool : vertices that stay; cell : mm, size of faces
    """
    v = half.vertices.copy()
    corner = half.faces
    a, b = (
        np.concatenate([x[corner[:, 3] >= 0] if k == 3 else x for k, x in enumerate(part)]) for part in _sides(corner)
    )
    n = len(v)
    link = coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(n, n)).tocsr()
    link.data[:] = 1.0
    degree = np.maximum(np.asarray(link.sum(axis=1)), 1)
    near = np.zeros(n)
    near[seam] = 1
    for _ in range(3):
        near = np.maximum(near, (link @ near > 0).astype(float))
    free = (near > 0) & ~fixed
    middle = v[:, 0] == 0
    for _ in range(rounds):
        step = link @ v / degree - v
        normal = vertex_normals(v, half.triangles)
        step -= (step * normal).sum(axis=1, keepdims=True) * normal
        v[free] += 0.5 * step[free]
        v[free] += towards_surface(field, v[free], cell / 3)
        v[middle, 0] = 0.0
        v[~middle, 0] = np.maximum(v[~middle, 0], 0.02)
    return half.moved(v)


def _sides(faces):
    """The four sides of faces (m, 4) as two tuples of vertex arrays; that of the fourth corner is for quads only."""
    third = np.where(faces[:, 3] >= 0, faces[:, 3], faces[:, 0])
    return (faces[:, 0], faces[:, 1], faces[:, 2], faces[:, 3]), (faces[:, 1], faces[:, 2], third, faces[:, 0])


def _band(vertices, a, b):
    """Faces (k, 4) between two chains that run the same way; the surface of the first lies to the left of ``a``."""
    pa, pb = vertices[a], vertices[b]
    rung = np.linalg.norm(pa[:, None] - pb[None], axis=2)
    n, m = rung.shape
    best = np.full((n, m), np.inf)
    came = np.zeros((n, m), int)
    best[0, 0] = rung[0, 0]
    for i in range(n):
        for j in range(m):
            options = (
                best[i - 1, j] + TRIANGLE if i else np.inf,
                best[i, j - 1] + TRIANGLE if j else np.inf,
                best[i - 1, j - 1] if i and j else np.inf,
            )
            k = int(np.argmin(options))
            if np.isfinite(options[k]):
                best[i, j], came[i, j] = options[k] + rung[i, j], k
    faces, i, j = [], n - 1, m - 1
    while i or j:
        k = came[i, j]
        if k == 0:
            faces.append((a[i], a[i - 1], b[j], -1))
            i -= 1
        elif k == 1:
            faces.append((a[i], b[j - 1], b[j], -1))
            j -= 1
        else:
            faces.append((a[i], a[i - 1], b[j - 1], b[j]))
            i, j = i - 1, j - 1
    return np.array(faces)


def _border(faces, vertices):
    """Directed border edges (a, b) of a half that do not lie on the midline."""
    size = np.where(faces[:, 3] >= 0, 4, 3)
    a, b = [], []
    for k in range(4):
        use = k < size
        nxt = np.where(k + 1 < size, k + 1, 0)
        a.append(faces[use, k])
        b.append(faces[np.flatnonzero(use), nxt[use]])
    a, b = np.concatenate(a).astype(np.int64), np.concatenate(b).astype(np.int64)
    key, back = a * 10**7 + b, b * 10**7 + a
    lone = ~np.isin(back, key) & ~((vertices[a, 0] == 0) & (vertices[b, 0] == 0))
    return a[lone], b[lone]


def _piece(faces):
    """(m,) bool, the faces of the largest connected piece."""
    n = int(faces.max()) + 1
    corner = np.where(faces < 0, faces[:, :1], faces)
    link = coo_matrix((np.ones(3 * len(faces)), (np.repeat(corner[:, 0], 3), corner[:, 1:].ravel())), shape=(n, n))
    label = connected_components(link, directed=False)[1][corner[:, 0]]
    return label == np.bincount(label).argmax()


def _compact(vertices, faces):
    used = np.unique(faces[faces >= 0])
    new = np.full(len(vertices), -1)
    new[used] = np.arange(len(used))
    return Mesh(vertices[used], np.where(faces >= 0, new[faces], -1).astype(np.int32))


def _well_split(vertices, faces):
    """Quads turned so that the diagonal from their first corner is the shorter one."""
    quad = faces[:, 3] >= 0
    p = vertices[np.where(faces < 0, 0, faces)]
    longer = np.linalg.norm(p[:, 0] - p[:, 2], axis=1) > np.linalg.norm(p[:, 1] - p[:, 3], axis=1)
    turn = quad & longer
    return np.where(turn[:, None], np.roll(faces, -1, axis=1), faces)
