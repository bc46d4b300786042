# SPDX-License-Identifier: GPL-3.0-or-later
"""Read and write polygon meshes as PLY (Turk 1994), ASCII and binary of both byte orders, in plain numpy.

Blender's importers read the artist's scans; this serves exports, tests and everyone without Blender.
"""

from pathlib import Path

import numpy as np

from ..anatomy.storage import write_atomically
from ..errors import InputError
from ..mesh import Mesh
from .ply_header import Element, read_header

FORMATS = ("binary_little_endian", "binary_big_endian", "ascii")
_FACE_LISTS = ("vertex_indices", "vertex_index")


def read_ply(path) -> Mesh:
    """The mesh in a PLY file; polygons of more than four corners become fans of triangles.

    Positions are returned as they stand in the file, in its own unit. ``colour`` is (n, 3) float32 in 0..1 or None.

    Raises
    ------
    InputError : the file is missing, empty, not PLY, truncated, without faces, or its counts or indices are absurd.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"{path} cannot be read ({error.strerror}): check the name and that you may read it."
        ) from error
    encoding, elements, start = read_header(data, path)
    reader = _AsciiBody(data[start:], path) if encoding == "ascii" else _BinaryBody(data, start, encoding, path)
    mesh = {}
    for element in elements:
        columns = reader.element(element)
        if element.name == "vertex":
            mesh["vertices"], mesh["colour"] = _vertices(columns, path)
        elif element.name == "face":
            lists = [columns[name] for name in _FACE_LISTS if name in columns]
            if lists:
                mesh["faces"] = _faces(*lists[0])
    if "vertices" not in mesh:
        raise InputError(f"{path} has no vertices: export the scan again as a mesh.")
    faces = mesh.get("faces")
    if faces is None or not len(faces):
        raise InputError(
            f"{path} has {len(mesh['vertices'])} points but no faces: make a mesh of the points (the scanner's "
            "software can) and export that."
        )
    if faces.min() < -1 or faces[:, :3].min() < 0 or faces.max() >= len(mesh["vertices"]):
        raise InputError(f"{path} is damaged, a face names a vertex that does not exist: export the scan again.")
    return Mesh(mesh["vertices"], faces, colour=mesh["colour"])


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
    try:
        write_atomically(path, "\n".join(header).encode("ascii", "replace") + body)
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror}): choose a folder you may write to.") from error


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
    if any(axis not in columns for axis in "xyz"):
        raise InputError(f"{path} has vertices without x, y and z: export the scan again as a mesh.")
    positions = np.stack([np.asarray(columns[axis], dtype=np.float64) for axis in "xyz"], axis=1)
    for names in (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b")):
        if all(name in columns for name in names):
            channels = [np.asarray(columns[name]) for name in names]
            scale = np.iinfo(channels[0].dtype).max if channels[0].dtype.kind in "ui" else 1.0
            return positions, np.stack([np.clip(c / scale, 0, 1) for c in channels], axis=1).astype(np.float32)
    return positions, None


def _faces(counts: np.ndarray, flat: np.ndarray) -> np.ndarray:
    """(m, 4) faces of polygons given as corner counts (p,) and all corners in a row."""
    flat = flat.astype(np.int64)
    start = np.cumsum(counts) - counts
    small = (counts == 3) | (counts == 4)
    out = np.full((int(small.sum()), 4), -1, dtype=np.int64)
    for k in range(4):
        has = counts[small] > k
        out[has, k] = flat[start[small][has] + k]
    big = counts > 4
    if big.any():
        fans = np.repeat(np.flatnonzero(big), counts[big] - 2)
        step = np.arange(len(fans)) - np.repeat(np.cumsum(counts[big] - 2) - (counts[big] - 2), counts[big] - 2)
        fan = np.full((len(fans), 4), -1, dtype=np.int64)
        for k, offset in enumerate((0, step + 1, step + 2)):
            fan[:, k] = flat[start[fans] + offset]
        out = np.concatenate([out, fan])
    return np.clip(out, -(2**31), 2**31 - 1).astype(np.int32)


class _BinaryBody:
    """Elements read one after the other from a binary body."""

    def __init__(self, data: bytes, start: int, encoding: str, path):
        self.data, self.at, self.path = data, start, path
        self.order = "<" if encoding == "binary_little_endian" else ">"

    def element(self, element: Element) -> dict:
        if not element.count:
            return {p.name: (np.zeros(0, int), np.zeros(0, int)) if p.count_type else [] for p in element.properties}
        lengths = self._first_lengths(element)
        columns = self._uniform(element, lengths)
        return columns if columns is not None else self._ragged(element)

    def _need(self, size: int) -> None:
        if self.at + size > len(self.data):
            raise _truncated(self.path)

    def _first_lengths(self, element) -> dict[str, int]:
        """List lengths of the first row: nearly every file has the same in all rows."""
        at, lengths = self.at, {}
        for p in element.properties:
            if p.count_type:
                width = np.dtype(p.count_type).itemsize
                if at + width > len(self.data):
                    raise _truncated(self.path)
                lengths[p.name] = int(np.frombuffer(self.data, self.order + p.count_type, 1, at)[0])
                at += width + max(lengths[p.name], 0) * np.dtype(p.type).itemsize
            else:
                at += np.dtype(p.type).itemsize
        return lengths

    def _uniform(self, element, lengths):
        """All rows at once if their lists are equally long, else None."""
        fields = []
        for p in element.properties:
            if p.count_type:
                if not 0 <= lengths[p.name] < 10_000:
                    return None
                fields.append((p.name + " length", self.order + p.count_type))
            shape = (lengths[p.name],) if p.count_type else ()
            fields.append((p.name, self.order + p.type, shape))
        row = np.dtype(fields)
        if self.at + row.itemsize * element.count > len(self.data):
            if not lengths:
                raise _truncated(self.path)
            return None
        table = np.frombuffer(self.data, row, element.count, self.at)
        if any((table[name + " length"] != length).any() for name, length in lengths.items()):
            return None
        self.at += row.itemsize * element.count
        return {
            p.name: (np.full(element.count, lengths[p.name]), table[p.name].ravel()) if p.count_type else table[p.name]
            for p in element.properties
        }

    def _ragged(self, element):
        """Row by row: where a row starts depends on all lists before it."""
        counts = {p.name: [] for p in element.properties if p.count_type}
        pieces = {p.name: [] for p in element.properties}
        for _ in range(element.count):
            for p in element.properties:
                length, width = 1, np.dtype(p.type).itemsize
                if p.count_type:
                    wide = np.dtype(p.count_type).itemsize
                    self._need(wide)
                    order = "little" if self.order == "<" else "big"
                    length = int.from_bytes(self.data[self.at : self.at + wide], order)
                    counts[p.name].append(length)
                    self.at += wide
                self._need(length * width)
                pieces[p.name].append(self.data[self.at : self.at + length * width])
                self.at += length * width
        columns = {}
        for p in element.properties:
            values = np.frombuffer(b"".join(pieces[p.name]), self.order + p.type)
            columns[p.name] = (np.array(counts[p.name], dtype=np.int64), values) if p.count_type else values
        return columns


class _AsciiBody:
    """Elements read one after the other from the numbers of an ASCII body."""

    def __init__(self, body: bytes, path):
        self.path, self.at = path, 0
        try:
            self.numbers = np.array(body.split(), dtype=np.float64)
        except ValueError as error:
            raise InputError(
                f"{path} is damaged, there is something that is no number in it: export the scan again."
            ) from error

    def element(self, element: Element) -> dict:
        lists = [p for p in element.properties if p.count_type]
        if not element.count:
            return {p.name: (np.zeros(0, int), np.zeros(0, int)) if p.count_type else [] for p in element.properties}
        if not lists:
            table = self._take(element.count * len(element.properties)).reshape(element.count, -1)
            return {p.name: table[:, k].astype(p.type) for k, p in enumerate(element.properties)}
        if len(element.properties) == 1 and self.at < len(self.numbers):  # one list a row, often equally long
            width = int(self.numbers[self.at]) + 1
            if width > 0 and self.at + width * element.count <= len(self.numbers):
                table = self.numbers[self.at : self.at + width * element.count].reshape(element.count, width)
                if (table[:, 0] == width - 1).all():
                    self.at += width * element.count
                    return {lists[0].name: (table[:, 0].astype(np.int64), table[:, 1:].ravel())}
        counts, pieces = {p.name: [] for p in lists}, {p.name: [] for p in element.properties}
        for _ in range(element.count):
            for p in element.properties:
                length = 1
                if p.count_type:
                    length = max(int(self._take(1)[0]), 0)
                    counts[p.name].append(length)
                pieces[p.name].append(self._take(length))
        return {
            p.name: (np.array(counts[p.name], dtype=np.int64), np.concatenate(pieces[p.name]))
            if p.count_type
            else np.concatenate(pieces[p.name]).astype(p.type)
            for p in element.properties
        }

    def _take(self, count: int) -> np.ndarray:
        if self.at + count > len(self.numbers):
            raise _truncated(self.path)
        self.at += count
        return self.numbers[self.at - count : self.at]


def _truncated(path) -> InputError:
    return InputError(f"{path} is truncated, its end is missing: copy or export it again.")
