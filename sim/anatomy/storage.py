# SPDX-License-Identifier: GPL-3.0-or-later
"""A head as one compressed file (``.npz``) and its anatomy as a JSON document (kept in the .blend as an ID property).

The document holds all of a head that is not a mesh: landmarks, feature mesh, muscles, jaw, eyes. Its ``format`` says
which version wrote it.
"""

import errno
import io
import json
import os
import tempfile
import zlib
from functools import cache
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from ..errors import InputError
from ..file_bytes import file_bytes
from ..mesh import Mesh
from .head import Eye, Head, Jaw, Muscle, SurfacePoints

FORMAT = "headshop-anatomy/1"
REFERENCE = Path(__file__).resolve().parents[2] / "assets" / "reference_head.npz"


def _numbers(array, digits=5):
    return np.round(np.asarray(array, dtype=float), digits).tolist()


def _mesh_document(mesh: Mesh) -> dict:
    return {"vertices": _numbers(mesh.vertices, 3), "faces": mesh.faces.tolist()}


def _mesh_from(document: dict) -> Mesh:
    return Mesh(
        np.array(document["vertices"], dtype=float).reshape(-1, 3), np.array(document["faces"], np.int32).reshape(-1, 4)
    )


def _points_document(points: SurfacePoints) -> dict:
    return {
        "names": list(points.names),
        "part": list(points.part),
        "corners": points.corners.tolist(),
        "weights": _numbers(points.weights, 7),
    }


def _points_from(document: dict) -> SurfacePoints:
    return SurfacePoints(
        tuple(document["names"]),
        tuple(document["part"]),
        np.array(document["corners"], dtype=np.int32).reshape(-1, 3),
        np.array(document["weights"], dtype=float).reshape(-1, 3),
    )


def anatomy_document(head: Head) -> dict:
    """All of ``head`` that is not a mesh part or a skin group, ready for JSON."""
    return {
        "format": FORMAT,
        "landmarks": _points_document(head.landmarks),
        "skull_landmarks": _points_document(head.skull_landmarks),
        "feature_mesh": head.feature_mesh.tolist(),
        "muscles": [
            {
                "name": m.name,
                "kind": m.kind,
                "fibres": _numbers(m.fibres, 4),
                "width": m.width,
                "thickness": m.thickness,
                "max_shortening": m.max_shortening,
                "origin": m.origin,
                "insertion": m.insertion,
                "ring": m.ring,
                "centre": None if m.centre is None else _numbers(m.centre, 4),
                "shape": _mesh_document(m.shape),
            }
            for m in head.muscles
        ],
        "jaw": {k: v if np.isscalar(v) else _numbers(v) for k, v in vars(head.jaw).items()},
        "eyes": [
            {
                "centre": _numbers(e.centre),
                "radius": e.radius,
                "gaze": _numbers(e.gaze, 7),
                "iris_radius": round(e.iris_radius, 4),
                "pupil_radius": round(e.pupil_radius, 4),
            }
            for e in head.eyes
        ],
    }


def head_from_document(parts: dict[str, Mesh], groups: dict[str, np.ndarray], document: dict) -> Head:
    """The head of which `anatomy_document` made ``document``.

    Raises
    ------
    InputError : the document was written by another format version.
    """
    if document.get("format") != FORMAT:
        raise InputError(
            f"This head was saved as {document.get('format')!r}, which this version of Head Shop does not read ({FORMAT}): "
            "rebuild it from the scan."
        )
    muscles = tuple(
        Muscle(
            name=m["name"],
            kind=m["kind"],
            fibres=np.array(m["fibres"], dtype=float),
            width=m["width"],
            thickness=m["thickness"],
            max_shortening=m["max_shortening"],
            origin=m["origin"],
            insertion=m["insertion"],
            shape=_mesh_from(m["shape"]),
            ring=m["ring"],
            centre=None if m["centre"] is None else np.array(m["centre"], dtype=float),
        )
        for m in document["muscles"]
    )
    jaw = Jaw(**{k: np.array(v, dtype=float) if isinstance(v, list) else v for k, v in document["jaw"].items()})
    eyes = tuple(
        Eye(
            np.array(e["centre"], float),
            e["radius"],
            np.array(e["gaze"], float),
            e.get("iris_radius", 0.0),
            e.get("pupil_radius", 0.0),
        )
        for e in document["eyes"]
    )
    return Head(
        parts=parts,
        groups=groups,
        landmarks=_points_from(document["landmarks"]),
        skull_landmarks=_points_from(document["skull_landmarks"]),
        feature_mesh=np.array(document["feature_mesh"], dtype=np.int32).reshape(-1, 3),
        muscles=muscles,
        jaw=jaw,
        eyes=eyes,
    )


def write_atomically(path, data: bytes) -> None:
    """Write under a temporary name beside ``path``, then rename; nothing is left behind on failure.

    Raises
    ------
    InputError : it cannot be written there.
    """
    path = Path(path)
    try:
        _write_beside(path, data)
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", None))
        advice = "is the disk full?" if full else "choose a folder you may write to."
        raise InputError(f"{path} cannot be written ({error.strerror}): {advice}") from error


def _write_beside(path: Path, data: bytes) -> None:
    handle, temporary = tempfile.mkstemp(prefix=".headshop-", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def save_head(head: Head, path) -> None:
    """Write ``head`` to an ``.npz`` file (same head, same bytes).

    Raises
    ------
    InputError : it cannot be written there.
    """
    arrays: dict[str, np.ndarray] = {"anatomy": np.array(json.dumps(anatomy_document(head)))}
    for name, mesh in head.parts.items():
        for field in ("vertices", "faces", "uv", "material"):
            value = getattr(mesh, field)
            if value is not None:
                arrays[f"part.{name}.{field}"] = value
    for name, weights in head.groups.items():
        arrays[f"group.{name}"] = np.asarray(weights, dtype=np.float32)
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    write_atomically(path, stream.getvalue())


@cache
def reference_head() -> Head:
    """The reference head, read once, for what is worked out from a head is kept with it (`sim.adapt.rest`, `shape_space`).

    Its meshes and groups cannot be written to: all who ask have the same ones.
    """
    head = load_head()
    for array in (*head.groups.values(), *(a for mesh in head.parts.values() for a in (mesh.vertices, mesh.faces))):
        array.flags.writeable = False
    return head


def load_head(path=REFERENCE) -> Head:
    """Read a head written by `save_head`; the reference head by default.

    Raises
    ------
    InputError : it cannot be read, is no such file or not all of one, or was written by another format version.
    """
    data = file_bytes(path)
    try:
        with np.load(io.BytesIO(data)) as file:
            arrays = {key: file[key] for key in file.files}
        document = json.loads(str(arrays["anatomy"]))
    except (ValueError, KeyError, TypeError, AttributeError, EOFError, OSError, BadZipFile, zlib.error) as error:
        raise InputError(f"{path} is no head that save_head wrote, or not all of one: save it again.") from error
    parts: dict[str, dict] = {}
    groups = {}
    for key, value in arrays.items():
        kind, _, rest = key.partition(".")
        if kind == "part":
            part, _, field = rest.partition(".")
            parts.setdefault(part, {})[field] = value
        elif kind == "group":
            groups[rest] = value
    meshes = {name: Mesh(**fields) for name, fields in parts.items()}
    return head_from_document(meshes, groups, document)
