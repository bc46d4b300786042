# SPDX-License-Identifier: GPL-3.0-or-later
"""Read and write polygon meshes, and read points, as PLY (Turk 1994), ASCII and binary of both byte orders, in plain numpy.

Blender's importers read the artist's scans; this serves exports, tests and everyone without Blender.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..anatomy.storage import write_atomically
from ..errors import InputError
from ..file_bytes import file_bytes
from ..mesh import Mesh
from ..point_cloud.splats import PACKED, are_splats, on_splats
from .ply_body import open_body
from .ply_header import read_header
from .ply_texture import corner_places

FORMATS = ("binary_little_endian", "binary_big_endian", "ascii")
_NORMAL = ("nx", "ny", "nz")
_FACE_LISTS = ("vertex_indices", "vertex_index")


def read_ply(path) -> Mesh:
    """The mesh in a PLY file without its pictures; polygons of more than four corners become fans of triangles.

    Positions are returned as they stand in the file, in its own unit. ``colour`` is (n, 3) float32 in 0..1 or None. A file
    without faces gives a mesh without faces, and the ``normals`` of its points if it has them; of Gaussian splats, points on
    them (`sim.point_cloud`).

    Raises
    ------
    InputError : the file is missing, empty, not PLY, truncated, without points, or its counts or indices are absurd.
    """
    return replace(read_textured_ply(path)[0], uv=None, material=None)


def read_textured_ply(path) -> tuple[Mesh, tuple[str, ...]]:
    """`read_ply`, with the places of its faces on pictures, and the names of those as the file has them.

    The mesh's ``material`` is an index into the names, or the number of them where a face shows none. It has neither that
    nor ``uv`` where the file names no picture, or has no places on it.

    Raises
    ------
    InputError : as `read_ply`, and for faces with places of other corners than theirs.
    """
    path = Path(path)
    data = file_bytes(path)
    header = read_header(data, path)
    body = open_body(data, header.start, header.encoding, path)
    columns = {element.name: body.element(element) for element in header.elements}
    if "vertex" not in columns:
        raise InputError(f"{path} has no vertices: export the scan again as a mesh.")
    of_vertices = {name: column for name, column in columns["vertex"].items() if not isinstance(column, tuple)}
    vertices, colour = _vertices(of_vertices, path)
    of_faces = columns.get("face", {})
    lists = [of_faces[name] for name in _FACE_LISTS if isinstance(of_faces.get(name), tuple)]
    counts, flat = lists[0] if lists else (np.zeros(0, np.int64), np.zeros(0, np.int64))
    corners, polygon = _corners(counts)
    if not len(corners):
        return _points(path, vertices, colour, of_vertices), ()
    named = np.append(np.clip(flat.astype(np.int64), -(2**31), 2**31 - 1), -1)  # the last is for the corner of none
    faces = named[corners].astype(np.int32)
    if faces.min() < -1 or named[corners[corners >= 0]].min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"{path} is damaged, a face names a vertex that does not exist: export the scan again.")
    mesh = Mesh(vertices, faces, colour=colour)
    if not header.pictures:
        return mesh, ()
    uv, material = corner_places(of_vertices, of_faces, counts, corners, polygon, faces, len(header.pictures), path)
    return replace(mesh, uv=uv, material=material), header.pictures


def write_ply(path, mesh: Mesh, encoding: str = "binary_little_endian", comments: tuple[str, ...] = ()) -> None:
    """Write ``mesh`` with float32 positions and, if it has colours, 8-bit colours. Nothing is left behind on failure.

    Raises
    ------
    InputError : the file cannot be written there.
    """
    if encoding not in FORMATS:
        raise ValueError(f"encoding must be one of {FORMATS}")
    order = ">" if encoding == "binary_big_endian" else "<"
    fields = [(axis, order + "f4") for axis in "xyz"]
    header = ["ply", f"format {encoding} 1.0", *(f"comment {line}" for line in comments)]
    header += [f"element vertex {len(mesh.vertices)}", *(f"property float {axis}" for axis in "xyz")]
    if mesh.colour is not None:
        fields += [(name, "u1") for name in ("red", "green", "blue")]
        header += [f"property uchar {name}" for name in ("red", "green", "blue")]
    header += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header", ""]
    vertices = np.zeros(len(mesh.vertices), dtype=fields)
    for k, axis in enumerate("xyz"):
        vertices[axis] = mesh.vertices[:, k]
    if mesh.colour is not None:
        rgb = np.clip(np.rint(mesh.colour * 255.0), 0, 255).astype(np.uint8)
        for k, name in enumerate(("red", "green", "blue")):
            vertices[name] = rgb[:, k]
    body = _ascii_text(vertices, mesh.faces) if encoding == "ascii" else _binary(vertices, mesh.faces, order)
    write_atomically(path, "\n".join(header).encode("ascii", "replace") + body)


def _binary(vertices, faces, order) -> bytes:
    out = np.zeros(len(faces), dtype=[("n", "u1"), ("corner", order + "i4", 4)])
    quad = faces[:, 3] >= 0
    out["n"] = np.where(quad, 4, 3)
    out["corner"] = faces
    raw = out.view(np.uint8).reshape(len(faces), 17)
    keep = np.ones(raw.shape, dtype=bool)
    keep[~quad, 13:] = False  # a triangle has no fourth corner in the file
    return vertices.tobytes() + raw[keep].tobytes()


def _ascii_text(vertices, faces) -> bytes:
    lines = [" ".join(f"{value:.9g}" for value in row) for row in vertices.tolist()]
    lines += [" ".join(map(str, [3, *row[:3]] if row[3] < 0 else [4, *row])) for row in faces.tolist()]
    return ("\n".join(lines) + "\n").encode("ascii")


def _vertices(columns, path):
    if PACKED in columns:
        raise InputError(f"{path} holds compressed Gaussian splats: export them as an uncompressed PLY.")
    if any(axis not in columns for axis in "xyz"):
        raise InputError(f"{path} has vertices without x, y and z: export the scan again as a mesh.")
    positions = np.stack([np.asarray(columns[axis], dtype=np.float64) for axis in "xyz"], axis=1)
    for names in (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b")):
        if all(name in columns for name in names):
            channels = [np.asarray(columns[name]) for name in names]
            scale = np.iinfo(channels[0].dtype).max if channels[0].dtype.kind in "ui" else 1.0
            return positions, np.stack([np.clip(c / scale, 0, 1) for c in channels], axis=1).astype(np.float32)
    return positions, None


def _corners(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m, 4) which of all corners in a row are those of the faces that polygons with ``counts`` (p,) corners become, -1 for the
    fourth of a triangle; and (m,) the polygon of each face."""
    start = np.cumsum(counts) - counts
    small = np.flatnonzero((counts == 3) | (counts == 4))
    out = start[small, None] + np.arange(4)
    out[counts[small] == 3, 3] = -1
    big = counts > 4
    fans = np.repeat(np.flatnonzero(big), counts[big] - 2)
    step = np.arange(len(fans)) - np.repeat(np.cumsum(counts[big] - 2) - (counts[big] - 2), counts[big] - 2)
    fan = np.stack([start[fans], start[fans] + step + 1, start[fans] + step + 2, np.full(len(fans), -1)], axis=1)
    return np.concatenate([out, fan]), np.concatenate([small, fans])


def _points(path, vertices, colour, columns) -> Mesh:
    """Points without faces, with their normals; or those on splats."""
    if not len(vertices):
        raise InputError(f"{path} has neither faces nor points: export the scan again.")
    if are_splats(columns):
        return on_splats(vertices, columns)
    normals = None
    if all(name in columns for name in _NORMAL):
        normals = np.stack([np.asarray(columns[name], dtype=np.float32) for name in _NORMAL], axis=1)
    return Mesh(vertices, np.zeros((0, 4), np.int32), colour=colour, normals=normals)
