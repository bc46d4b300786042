# SPDX-License-Identifier: GPL-3.0-or-later
"""A polygon mesh of triangles and quads as plain arrays."""

from dataclasses import dataclass, replace

import numpy as np

from .errors import InputError


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles and quads in one table.

    Attributes
    ----------
    vertices : (n, 3) float64, mm
    faces : (m, 4) int32, corners counter-clockwise seen from outside; a triangle has -1 in the last column, which may be
        left out where all are
    uv : (m, 4, 2) float32 or None, texture coordinates per face corner
    material : (m,) int16 or None, index into the part's material names (`headshop.sim.anatomy.head.MATERIALS`), or into
        the ``pictures`` of a scan
    colour : (n, 3) float32 or None, sRGB colour per vertex, 0..1 (scans)
    normals : (n, 3) float32 or None, which way the surface faces at points that have no faces (scans)
    pictures : (h, w, 3) uint8 each, sRGB, first row at the bottom: what faces of that material show; None: nothing (scans)

    Raises
    ------
    InputError : vertices or faces have another shape, or faces are no whole numbers; lists and numbers of other kinds are
        taken.
    """

    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray | None = None
    material: np.ndarray | None = None
    colour: np.ndarray | None = None
    normals: np.ndarray | None = None
    pictures: tuple[np.ndarray | None, ...] = ()

    def __post_init__(self):
        object.__setattr__(self, "vertices", _table(self.vertices, "vertices", 3, np.float64))
        object.__setattr__(self, "faces", _table(self.faces, "faces", 4, np.int32))

    @classmethod
    def from_triangles(cls, vertices, triangles, **more) -> "Mesh":
        """A mesh of triangles (m, 3). Raises `InputError` where they have another shape or are no
        whole numbers."""
        triangles = _table(triangles, "triangles", 3, np.int32)
        faces = np.full((len(triangles), 4), -1, dtype=np.int32)
        faces[:, :3] = triangles
        return cls(vertices, faces, **more)

    @property
    def triangles(self) -> np.ndarray:
        """(t, 3) int32: quads split along the diagonal 0-2; the triangles of one quad follow each other."""
        first = self.faces[:, [0, 1, 2]]
        quad = self.faces[:, 3] >= 0
        position = np.arange(len(self.faces)) + np.cumsum(quad) - quad
        out = np.empty((len(self.faces) + int(quad.sum()), 3), dtype=np.int32)
        out[position] = first
        out[position[quad] + 1] = self.faces[quad][:, [0, 2, 3]]
        return out

    def moved(self, vertices: np.ndarray) -> "Mesh":
        """The same mesh with other vertex positions (n, 3).

        Raises
        ------
        InputError : not as many positions as vertices.
        """
        vertices = np.asarray(vertices, dtype=np.float64)
        if vertices.shape != self.vertices.shape:
            shape = self.vertices.shape
            raise InputError(
                f"A mesh of {shape[0]} vertices cannot take positions of shape {vertices.shape}: give {shape}."
            )
        return replace(self, vertices=vertices)

    def transformed(self, matrix: np.ndarray) -> "Mesh":
        """The same mesh with its positions and normals mapped by ``matrix`` (3, 3); what is mirrored keeps its outside."""
        matrix = np.asarray(matrix, dtype=np.float64)
        out = self.moved(self.vertices @ matrix.T)
        if self.normals is not None:
            normals = self.normals @ np.linalg.inv(matrix)
            length = np.linalg.norm(normals, axis=1, keepdims=True)
            out = replace(out, normals=(normals / np.where(length > 0, length, 1)).astype(np.float32))
        if np.linalg.det(matrix) > 0:
            return out
        order = np.where(self.faces[:, 3:] >= 0, [0, 3, 2, 1], [0, 2, 1, 3])
        uv = None if self.uv is None else np.take_along_axis(self.uv, order[:, :, None], axis=1)
        return replace(out, faces=np.take_along_axis(self.faces, order, axis=1), uv=uv)


def _table(values, name: str, columns: int, kind) -> np.ndarray:
    """(k, columns) of ``values``, which may come one after another too."""
    try:
        given = np.asarray(values)
        with np.errstate(invalid="ignore"):  # NaN as a whole number
            table = given.astype(kind, copy=False)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"The {name} of a mesh are no table of numbers ({error}): give (n, {columns}).") from None
    if kind is np.int32 and table.dtype != given.dtype and not np.array_equal(table, given):
        raise InputError(
            f"The {name} of a mesh are not all whole numbers below 2^31: give indices of vertices, from 0 on."
        )
    if table.ndim == 2 and table.shape[1] == columns:
        return table  # itself, where it is one already
    if name == "faces" and table.ndim == 2 and table.shape[1] == 3:
        return np.pad(table, ((0, 0), (0, 1)), constant_values=-1)
    if table.size and (table.ndim != 1 or table.size % columns):
        raise InputError(f"The {name} of a mesh have the shape {table.shape}: give (n, {columns}).")
    return table.reshape(-1, columns)


def require_surface(scan: Mesh) -> None:
    """Raise `InputError` unless ``scan`` has faces, of vertices that it has, in finite places."""
    if not isinstance(scan, Mesh):
        raise InputError(f"The scan is given as {type(scan).__name__}: give a Mesh, such as Mesh.from_triangles makes.")
    count, corners = len(scan.vertices), scan.faces
    if not count or not len(corners):
        raise InputError("The scan has no faces: give a surface; scan.clean.clean_scan makes one of points.")
    if corners[:, :3].min() < 0 or corners.max() >= count:
        wrong = corners.max() if corners.max() >= count else corners[:, :3].min()
        raise InputError(
            f"A face of the scan has the vertex {wrong}, and there are {count}, from 0 on: correct its faces."
        )
    if not np.isfinite(scan.vertices).all():
        raise InputError(
            "The scan has vertices in places that are no finite numbers: scan.clean.clean_scan leaves them out."
        )


def vertex_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(n, 3) unit normals, area-weighted; zero where a vertex has no triangle."""
    planes = vertices.T.copy()
    normal = cross_sides(*(planes.take(triangles[:, k], axis=1) for k in range(3)))
    out, corner = np.empty_like(vertices), triangles.ravel()
    for axis in range(3):
        out[:, axis] = np.bincount(corner, np.repeat(normal[axis], 3), minlength=len(vertices))
    length = np.linalg.norm(out, axis=1, keepdims=True)
    return out / np.where(length > 0, length, 1)


def vertex_areas(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(n,) a third of the triangles around each vertex, mm²."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return np.bincount(triangles.ravel(), np.repeat(area, 3), minlength=len(vertices)) / 3


def cross_sides(a, b, c) -> np.ndarray:
    """(3, m): the cross product of the sides ``b - a`` and ``c - a``; all as planes (3, m), which is fastest."""
    (ux, uy, uz), (vx, vy, vz) = b - a, c - a
    return np.stack([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx])


def edges(faces: np.ndarray) -> np.ndarray:
    """(e, 2) int32 unique undirected edges of a face table (triangles: -1 in the last column, or three columns)."""
    faces = np.asarray(faces)
    if faces.shape[1] == 3:
        pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    else:
        quad = faces[:, 3] >= 0
        tri, four = faces[~quad], faces[quad]
        pairs = np.concatenate(
            [tri[:, [0, 1]], tri[:, [1, 2]], tri[:, [2, 0]]]
            + [four[:, [0, 1]], four[:, [1, 2]], four[:, [2, 3]], four[:, [3, 0]]]
        )
    span = int(pairs.max(initial=0)) + 1
    low, high = np.minimum(*pairs.T), np.maximum(*pairs.T)
    key = np.unique(low.astype(np.int64) * span + high)  # far faster than unique rows
    return np.stack([key // span, key % span], axis=1).astype(np.int32)


def ends_of(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(m, 3) mm: those of a surface's vertices (n, 3) at which it ends, on sides that belong to one of its triangles (t, 3)."""
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64), axis=1)
    side, count = np.unique(sides @ [len(vertices), 1], return_counts=True)
    return vertices[np.unique(np.divmod(side[count == 1], len(vertices)))]


def surface_points(vertices: np.ndarray, corners: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(k, 3) points from vertex indices (k, 3) and barycentric weights (k, 3)."""
    return np.einsum("kij,ki->kj", vertices[corners], weights)
