# SPDX-License-Identifier: GPL-3.0-or-later
"""A head as plain files for programs that have no Blender: meshes as PLY, the rest as JSON, shapes as ``.npz``.

All in mm, Z up, face toward -Y, in the scan's own place. ``skin.ply`` is the surface as Blender draws it, the cage
subdivided once, with the front of the eyeballs between open lids and a film between open lips; ``skin_as_scanned.ply`` is
the same, vertex by vertex, of a relaxed face with the expression that it was scanned with. Shapes have the cage's own
vertices, each where it comes to lie on that surface, the limit of subdivision; landmarks lie there too. A baked performance
is weights of the shapes over time.
"""

import io
from pathlib import Path

import bpy
import numpy as np

from ..sim.adapt.landmarks import write_landmarks
from ..sim.anatomy.head import Head
from ..sim.anatomy.seen_skin import seen_skin
from ..sim.anatomy.storage import write_atomically
from ..sim.mesh import Mesh
from ..sim.mesh_subdivision import drawn
from ..sim.scan.ply import write_ply
from . import bridge, detail_images, head_place, heads, performance, shape_keys
from .plain_files import muscles_document, write_json


def write_plain(skin: bpy.types.Object, folder) -> None:
    """Write the head into ``folder`` (which exists): the files of `plain_files.FILES`, of a bake only if there was one.

    Raises
    ------
    InputError : not a whole head (`heads.read_head`).
    """
    folder = Path(folder)
    cage = heads.read_head(skin)
    head = as_drawn(cage)
    report = heads.read_report(skin)
    parts = {"skin": seen_skin(cage), **{part: head.parts[part] for part in ("skull", "mandible")}}
    scanned = shape_keys.as_scanned(skin)
    if scanned is not None:
        parts["skin_as_scanned"] = seen_skin(cage.with_vertices({"skin": scanned}))
    for part, mesh in parts.items():
        write_ply(folder / f"{part}.ply", Mesh.from_triangles(mesh.vertices, mesh.triangles))
    write_landmarks(folder / "landmarks.json", head.landmark_positions(), report.get("landmarks_missing", ()))
    write_landmarks(folder / "skull_landmarks.json", head.skull_landmark_positions())
    write_json(folder / "muscles.json", muscles_document(head))
    write_json(folder / "report.json", report)
    shapes = shapes_arrays(skin, head)
    if len(shapes["names"]):
        _write_arrays(folder / "shapes.npz", shapes)
    acting = performance_arrays(skin, shapes["names"])
    if acting is not None:
        _write_arrays(folder / "performance.npz", acting)
    detail_images.write_files(skin, folder)


def as_drawn(head: Head) -> Head:
    """The head with its skin's vertices on the surface drawn of it, where a scan was fitted."""
    return head.with_vertices({"skin": drawn(head.skin.faces, head.skin.vertices)})


def shapes_arrays(skin: bpy.types.Object, head: Head) -> dict[str, np.ndarray]:
    """``names`` (k,), ``basis`` (n, 3), ``deltas`` (k, n, 3) in mm and ``triangles`` (m, 3) of the baked shapes:
    poses first, then what a baked performance consists of.

    ``head`` has its skin as drawn (`as_drawn`).
    """
    acting = performance.baked_weights(skin)
    names = [*shape_keys.baked_names(skin), *(acting[0] if acting is not None else ())]
    basis, faces = head.skin.vertices, head.skin.faces
    deltas = [drawn(faces, bridge.read_positions(skin, name)) - basis for name in names]
    return {
        "names": np.array(names, dtype=str),
        "basis": basis,
        "deltas": np.array(deltas, dtype=np.float32).reshape(len(names), len(basis), 3),
        "triangles": head.skin.triangles,
    }


def performance_arrays(skin: bpy.types.Object, names: np.ndarray) -> dict[str, np.ndarray] | None:
    """``names`` (k,) of all baked shapes, as they come in; ``fps``, frames a second; ``frames`` (f,), numbers in the scene;
    ``weights`` (f, k), 0 for shapes that are none of the performance. None if none was baked.

    With `shapes_arrays`, ``basis + np.tensordot(weights[i], deltas, 1)`` is the skin in ``frames[i]``. The head stays where it
    is: what moves all of it (``head_x``, ``head_turn`` and the like) is no shape.
    """
    acting = performance.baked_weights(skin)
    if acting is None:
        return None
    own, frames, played = acting
    weights = np.zeros((len(frames), len(names)), dtype=np.float32)
    weights[:, [names.tolist().index(name) for name in own]] = played
    fps = head_place.frame_rate(bpy.context.scene)
    return {"names": names, "fps": np.array(fps), "frames": frames.astype(np.int32), "weights": weights}


def _write_arrays(path: Path, arrays: dict[str, np.ndarray]) -> None:
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    write_atomically(path, stream.getvalue())
