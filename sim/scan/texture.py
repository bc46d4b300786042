# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of a scan that come from pictures on it, as photogrammetry and phones deliver them, at any of its points."""

import numpy as np

from ..mesh import Mesh, vertex_normals

#: Texels of a picture that are averaged along each side, at most: more would bleed over the borders of its islands.
COARSEST = 4
MOST_PARTS = 64  # into which the side of a triangle is cut
#: Of its longest side, that a triangle counts as wide at least, lest points lie far apart along slender ones.
SLENDER = 1 / 3


def has_pictures(mesh: Mesh) -> bool:
    """Whether the colour of any part of ``mesh`` comes from a picture."""
    return mesh.uv is not None and mesh.material is not None and any(picture is not None for picture in mesh.pictures)


def triangle_corners(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Texture coordinates (t, 3, 2) and material (t,) of the `Mesh.triangles` of a mesh that has both."""
    quad = mesh.faces[:, 3] >= 0
    row = np.repeat(np.arange(len(mesh.faces)), 1 + quad)
    second = np.r_[False, row[1:] == row[:-1]]
    corner = np.where(second[:, None], [0, 2, 3], [0, 1, 2])
    return mesh.uv[row[:, None], corner], mesh.material[row]


def vertex_colours(mesh: Mesh) -> np.ndarray:
    """(n, 3) float32 sRGB 0..1: the mean of what the pictures of ``mesh`` show at the corners that meet in each vertex.

    Where no picture is, it is the vertex's own colour, or white.
    """
    triangles = mesh.triangles
    sides = np.linalg.norm(np.diff(mesh.vertices[triangles], axis=1), axis=2)
    corners = np.repeat(np.arange(len(triangles)), 3), np.tile(np.eye(3), (len(triangles), 1))
    shown, seen = _shown(mesh, *corners, spacing=0.5 * float(np.median(sides)))
    vertex = triangles.ravel()[seen]
    count = np.bincount(vertex, minlength=len(mesh.vertices))
    sums = [np.bincount(vertex, shown[seen, k], minlength=len(mesh.vertices)) for k in range(3)]
    own = np.ones((len(mesh.vertices), 3)) if mesh.colour is None else mesh.colour
    mean = np.stack(sums, axis=1) / np.maximum(count, 1)[:, None]
    return np.where(count[:, None] > 0, mean, own).astype(np.float32)


def strewn(mesh: Mesh, spacing: float, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (k, 3) all over a mesh with pictures, its normals there (k, 3), and their sRGB colours (k, 3) 0..1.

    spacing : how far apart they are about, in the mesh's unit; chosen (t,) bool : the triangles that are strewn
    """
    triangles, some = mesh.triangles, np.flatnonzero(chosen)
    corners = mesh.vertices[triangles[some]]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    wide = np.sqrt(np.linalg.norm(np.cross(*np.diff(corners, axis=1).swapaxes(0, 1)), axis=1) / 2)
    parts = np.clip(np.ceil(np.maximum(wide, longest * SLENDER) / spacing), 1, MOST_PARTS).astype(int)
    owner, weights = [], []
    for n in np.unique(parts):
        of, inside = some[parts == n], _spread(n)
        owner.append(np.repeat(of, len(inside)))
        weights.append(np.tile(inside, (len(of), 1)))
    owner, weights = np.concatenate(owner), np.concatenate(weights)
    shown, seen = _shown(mesh, owner, weights, spacing)
    corner = triangles[owner]

    def across(values):
        return np.einsum("kc,kcd->kd", weights, values[corner])

    if not seen.all():
        own = np.ones((len(mesh.vertices), 3)) if mesh.colour is None else mesh.colour
        shown = np.where(seen[:, None], shown, across(np.asarray(own, dtype=float)))
    normals = across(vertex_normals(mesh.vertices, triangles))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return across(mesh.vertices), normals, shown


def _spread(n: int) -> np.ndarray:
    """(n * n, 3) weights of the middles of the triangles into which one is cut whose sides are cut into ``n`` parts."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    up, down = i + j < n, i + j < n - 1
    a = np.concatenate([i[up] + 1 / 3, i[down] + 2 / 3]) / n
    b = np.concatenate([j[up] + 1 / 3, j[down] + 2 / 3]) / n
    return np.stack([1 - a - b, a, b], axis=1)


def _shown(mesh: Mesh, owner: np.ndarray, weights: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """sRGB (k, 3) 0..1 that pictures show at points of the triangles ``owner`` (k,) with ``weights`` (k, 3), and (k,) bool
    whether there is a picture."""
    uv, material = triangle_corners(mesh)
    out, seen = np.zeros((len(owner), 3)), np.zeros(len(owner), dtype=bool)
    for index, picture in enumerate(mesh.pictures):
        if picture is None:
            continue
        mine = np.flatnonzero(material[owner] == index)
        if len(mine) == 0:
            continue
        coarse = _averaged(picture, spacing / _size_of_most(*_texels(mesh, uv, material == index, picture)))
        place = np.einsum("kc,kcd->kd", weights[mine], uv[owner[mine]].astype(float))
        out[mine], seen[mine] = _between(coarse, place), True
    return out, seen


def texel_size(mesh: Mesh, chosen: np.ndarray) -> float:
    """The size, in the mesh's unit, that most texels of its pictures have on the triangles ``chosen`` (t,) bool; inf: none is
    there."""
    uv, material = triangle_corners(mesh)
    shown = [
        _texels(mesh, uv, chosen & (material == index), picture)
        for index, picture in enumerate(mesh.pictures)
        if picture is not None
    ]
    return _size_of_most(*(np.concatenate(each) for each in zip(*shown, strict=True)))


def _texels(mesh, uv, of, picture):
    """The area of each of the triangles ``of`` (t,) bool of a mesh, and how many texels of ``picture`` it shows."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles[of]], 1, 0)
    p, q, r = np.moveaxis(uv[of].astype(float) * picture.shape[1::-1], 1, 0)
    texels = np.abs((q - p)[:, 0] * (r - p)[:, 1] - (q - p)[:, 1] * (r - p)[:, 0]) / 2
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2, texels


def _size_of_most(area, texels) -> float:
    some = (texels > 0) & (area > 0)
    return float(np.sqrt(np.median(area[some] / texels[some]))) if some.any() else np.inf


def _averaged(picture, texels: float) -> np.ndarray:
    """``picture`` with so many of its texels along each side made one, as far as that is sensible; 0..255 as it is."""
    n = int(np.clip(np.nan_to_num(texels), 1, min(COARSEST, *picture.shape[:2])))
    if n == 1:
        return picture
    height, width = (side // n * n for side in picture.shape[:2])
    # whole blocks only: the last rows of a size that is no multiple are as good as their neighbours
    return picture[:height, :width].reshape(height // n, n, width // n, n, 3).mean(axis=(1, 3), dtype=np.float32)


def _between(picture, place) -> np.ndarray:
    """(k, 3) 0..1, the colours of ``picture`` (h, w, 3) 0..255 at ``place`` (k, 2), between its texels; it repeats beyond its
    sides."""
    height, width = picture.shape[:2]
    x, y = (np.mod(place, 1.0) * [width, height] - 0.5).T
    left, low = np.floor(x).astype(int), np.floor(y).astype(int)
    right, up = (x - left)[:, None], (y - low)[:, None]
    columns, rows = (left % width, (left + 1) % width), (low % height, (low + 1) % height)
    below, above = ((1 - right) * picture[row, columns[0]] + right * picture[row, columns[1]] for row in rows)
    return ((1 - up) * below + up * above) / 255.0
