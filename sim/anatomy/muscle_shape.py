# SPDX-License-Identifier: GPL-3.0-or-later
"""The belly of a muscle as a closed surface round its fibres, made again after every warp (Kähler 2002, 5.2, item 3).

A muscle's surface is a flat tube: its middle sheet is spanned by the fibres, its thickness swells from a tendon at
either end to the belly, and it never reaches beyond the room between skin and bone.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from ..mesh import Mesh, vertex_normals
from .head import Muscle

#: Stations along a muscle and around a ring, columns across its sheet: heads share connectivity.
ALONG, AROUND, ACROSS = 14, 28, 6
#: Share of the belly's thickness left at a tendon.
TENDON = 0.22


class Room:
    """The soft tissue between skin and bone.

    skin, bones : meshes, mm; bones may be empty. inner : (n,) bool, the skin's vertices that line mouth, nose and
    lids (the group ``inner``). Distances are to points sampled on the surfaces.
    """

    def __init__(self, skin: Mesh, bones: list[Mesh], inner: np.ndarray | None = None):
        inner = np.zeros(len(skin.vertices), bool) if inner is None else np.asarray(inner, bool)
        lining = inner[skin.triangles].all(axis=1)
        self._skin = _Samples([(skin.vertices, skin.triangles[~lining])])
        inside = [(mesh.vertices, mesh.triangles) for mesh in bones]
        if lining.any():
            inside.append((skin.vertices, skin.triangles[lining]))
        self._inside = _Samples(inside) if inside else None

    def outward(self, points):
        """(n, 3) unit direction to the skin's outside, (n,) mm of room to the skin and to bone or lining."""
        normal, to_skin = self._skin.normal_and_distance(points)
        inside = np.full(len(points), np.inf) if self._inside is None else self._inside.normal_and_distance(points)[1]
        return normal, to_skin, inside


class _Samples:
    def __init__(self, meshes):
        points, normals = [], []
        for vertices, corner in meshes:
            normal = vertex_normals(vertices, corner)
            used = np.unique(corner)
            points += [vertices[used], vertices[corner].mean(axis=1)]
            normals += [normal[used], normal[corner].mean(axis=1)]
        self._tree = cKDTree(np.concatenate(points))
        self._normals = np.concatenate(normals)

    def normal_and_distance(self, points):
        distance, near = self._tree.query(points, k=8)
        weight = 1 / (distance + 1.0) ** 2
        normal = (weight[..., None] * self._normals[near]).sum(axis=1)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        # Samples lie some mm apart: the plane through the nearest tells the distance better than the sample itself.
        height = np.abs(((points - self._tree.data[near[:, 0]]) * self._normals[near[:, 0]]).sum(axis=1))
        return normal, np.maximum(height, 0.3 * distance[:, 0])


def muscle_shape(fibres: np.ndarray, width: float, thickness: float, ring=False, room: Room | None = None) -> Mesh:
    """The closed surface of a muscle.

    Parameters
    ----------
    fibres : (f, p, 3) mm, f >= 2 side by side; a closed ring repeats no point
    width : mm, least width of the belly (the fibres may span more)
    thickness : mm of the belly
    ring : a sphincter that closes on itself
    room : skin and bone that bound it; without it the sheet's own normal is used and nothing bounds it
    """
    fibres = np.asarray(fibres, dtype=float)
    sheet = _resampled(fibres, ring)
    along = np.roll(sheet, -1, 1) - np.roll(sheet, 1, 1) if ring else np.gradient(sheet, axis=1)
    flat = sheet.reshape(-1, 3)
    own = np.cross(along, np.gradient(sheet, axis=0)).reshape(-1, 3)
    own /= np.maximum(np.linalg.norm(own, axis=1, keepdims=True), 1.0)
    if room is None:
        normal = own
        to_skin = to_bone = np.full(len(flat), np.inf)
    else:
        normal, to_skin, to_bone = room.outward(flat)
        normal = 0.4 * normal + own * np.sign((own * normal).sum(1, keepdims=True))
    normal = normal - _share(normal, along.reshape(-1, 3))
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    normal = _steadied(normal.reshape(sheet.shape), ring)
    sheet = _spread(sheet, along, normal, width, ring)

    belly = np.ones(AROUND) if ring else _belly(np.linspace(0, 1, ALONG))
    across = np.linspace(-1, 1, ACROSS)
    round_off = np.sqrt(np.maximum(1 - across**2, 0))
    half = 0.5 * thickness * belly[None] * round_off[:, None]
    over = np.minimum(half, np.maximum(0.75 * to_skin.reshape(half.shape), 0.15))
    under = np.minimum(half, np.maximum(0.9 * to_bone.reshape(half.shape), 0.15))
    top, bottom = sheet + over[..., None] * normal, sheet - under[..., None] * normal
    # Once around a cross-section: over the top, back along the underside; the two edges are shared.
    rings = np.concatenate([top, bottom[1:-1][::-1]]).transpose(1, 0, 2)
    return _closed_tube(rings, ring)


def reshaped(muscle: Muscle, fibres: np.ndarray, room: Room | None = None, centre: np.ndarray | None = None) -> Muscle:
    """``muscle`` with other fibres (f, p, 3) mm and the surface that belongs to them."""
    shape = muscle_shape(fibres, muscle.width, muscle.thickness, muscle.ring, room)
    return replace(muscle, fibres=fibres, shape=shape, centre=muscle.centre if centre is None else centre)


def _resampled(fibres, ring):
    """(ACROSS, ALONG or AROUND, 3): the fibres at even stations, and even columns between the outermost."""
    count = len(fibres)
    if ring:
        fibres = np.concatenate([fibres, fibres[:, :1]], axis=1)
    at = np.linspace(0, fibres.shape[1] - 1, AROUND + 1)[:-1] if ring else np.linspace(0, fibres.shape[1] - 1, ALONG)
    i = np.minimum(at.astype(int), fibres.shape[1] - 2)
    t = (at - i)[None, :, None]
    even = fibres[:, i] * (1 - t) + fibres[:, i + 1] * t
    at = np.linspace(0, count - 1, ACROSS)
    i = np.minimum(at.astype(int), max(count - 2, 0))
    t = (at - i)[:, None, None]
    return even[i] * (1 - t) + even[np.minimum(i + 1, count - 1)] * t


def _share(vectors, along):
    length = np.maximum((along**2).sum(1, keepdims=True), 1e-12)
    return (vectors * along).sum(1, keepdims=True) / length * along


def _steadied(normal, ring):
    """Normals smoothed along the muscle, so that its surface does not ripple."""
    for _ in range(3):
        before, after = np.roll(normal, 1, 1), np.roll(normal, -1, 1)
        if not ring:
            before[:, 0], after[:, -1] = normal[:, 0], normal[:, -1]
        normal = normal + 0.5 * (before + after)
        normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-9)
    return normal


def _spread(sheet, along, normal, width, ring):
    """The sheet widened about its middle line where the fibres run closer than the muscle is wide there."""
    if ring:  # the fibres of a ring tell its width themselves
        return sheet
    side = np.cross(normal.mean(axis=0), along.mean(axis=0))
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
    span = ((sheet[-1] - sheet[0]) * side).sum(axis=1)
    if span.sum() < 0:
        side, span = -side, -span
    want = width * (0.30 + 0.70 * _belly(np.linspace(0, 1, ALONG)))
    lack = np.maximum(want - np.maximum(span, 0), 0)
    return sheet + np.linspace(-0.5, 0.5, ACROSS)[:, None, None] * (lack[:, None] * side)[None]


def _belly(t):
    """Thickness along a muscle as a share of the belly's: tendon, belly, tendon."""
    swell = np.sin(np.pi * np.clip(t, 0, 1)) ** 0.7
    return TENDON + (1 - TENDON) * swell


def _closed_tube(rings, ring):
    """Mesh of (k, m, 3) cross-sections joined by quads, closed on itself or by caps, facing outward."""
    k, m = rings.shape[:2]
    vertices = rings.reshape(-1, 3)
    j = np.arange(m)
    step = np.arange(k if ring else k - 1)
    a, b = (step * m)[:, None], ((step + 1) % k * m)[:, None]
    faces = np.stack([a + j, b + j, b + (j + 1) % m, a + (j + 1) % m], axis=-1).reshape(-1, 4)
    if not ring:
        # Caps: quads across the flat end, from edge to edge.
        half = m // 2
        top = np.arange(half + 1)
        low = (m - top) % m
        cap = np.stack([top[:-1], top[1:], low[1:], low[:-1]], axis=1)
        cap = _without_doubles(cap)
        faces = np.concatenate([faces, cap, _flipped(cap + (cap >= 0) * (k - 1) * m)])
    faces = faces.astype(np.int32)
    mesh = Mesh(vertices, faces)
    t = vertices[mesh.triangles] - vertices.mean(axis=0)
    volume = np.einsum("ij,ij->", t[:, 0], np.cross(t[:, 1], t[:, 2]))
    return mesh if volume > 0 else Mesh(vertices, _flipped(faces))


def _without_doubles(quads):
    """Quads with a repeated corner as triangles."""
    out = quads.copy()
    first = quads[:, 0] == quads[:, 3]
    out[first] = np.column_stack([quads[first][:, :3], np.full(first.sum(), -1)])
    last = (quads[:, 1] == quads[:, 2]) & ~first
    out[last] = np.column_stack([quads[last][:, [0, 1, 3]], np.full(last.sum(), -1)])
    return out


def _flipped(faces):
    quad = faces[:, 3:] >= 0
    return np.where(quad, faces[:, [0, 3, 2, 1]], faces[:, [0, 2, 1, 3]])
