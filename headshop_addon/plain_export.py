# SPDX-License-Identifier: GPL-3.0-or-later
"""A head as plain files for programs that have no Blender: meshes as PLY, the rest as JSON, shapes as ``.npz``.

All in mm, Z up, face toward -Y, in the scan's own place. ``skin.ply`` is the surface as Blender draws it, the cage
subdivided once, with the front of the eyeballs between open lids and a film between open lips. Shapes have the cage's
own vertices, each where it comes to lie on that surface, the limit of subdivision; landmarks lie there too.
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
from . import bridge, detail_images, heads, shape_keys
from .plain_files import muscles_document, write_json


def write_plain(skin: bpy.types.Object, folder) -> None:
    """Write the head into ``folder`` (which exists): the files of `plain_files.FILES`, shapes only if any were baked.

    Raises
    ------
    InputError : not a whole head (`heads.read_head`).
    """
    folder = Path(folder)
    cage = heads.read_head(skin)
    head = as_drawn(cage)
    report = heads.read_report(skin)
    parts = {"skin": seen_skin(cage), **{part: head.parts[part] for part in ("skull", "mandible")}}
    for part, mesh in parts.items():
        write_ply(folder / f"{part}.ply", Mesh.from_triangles(mesh.vertices, mesh.triangles))
    write_landmarks(folder / "landmarks.json", head.landmark_positions(), report.get("landmarks_missing", ()))
    write_landmarks(folder / "skull_landmarks.json", head.skull_landmark_positions())
    write_json(folder / "muscles.json", muscles_document(head))
    write_json(folder / "report.json", report)
    shapes = shapes_arrays(skin, head)
    if len(shapes["names"]):
        stream = io.BytesIO()
        np.savez_compressed(stream, **shapes)
        write_atomically(folder / "shapes.npz", stream.getvalue())
    detail_images.write_files(skin, folder)


def as_drawn(head: Head) -> Head:
    """The head with its skin's vertices on the surface drawn of it, where a scan was fitted."""
    return head.with_vertices({"skin": drawn(head.skin.faces, head.skin.vertices)})


def shapes_arrays(skin: bpy.types.Object, head: Head) -> dict[str, np.ndarray]:
    """``names`` (k,), ``basis`` (n, 3), ``deltas`` (k, n, 3) in mm and ``triangles`` (m, 3) of the baked shapes.

    ``head`` has its skin as drawn (`as_drawn`).
    """
    names = shape_keys.baked_names(skin)
    basis, faces = head.skin.vertices, head.skin.faces
    deltas = [drawn(faces, bridge.read_positions(skin, name)) - basis for name in names]
    return {
        "names": np.array(names, dtype=str),
        "basis": basis,
        "deltas": np.array(deltas, dtype=np.float32).reshape(len(names), len(basis), 3),
        "triangles": head.skin.triangles,
    }
