# SPDX-License-Identifier: GPL-3.0-or-later
"""Several meshes of a scan as one, with what colours each."""

from dataclasses import replace

import numpy as np

from ..mesh import Mesh
from .texture import has_pictures, vertex_colours


def joined(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one; colours are kept if any has them (white elsewhere), UVs where they lead to pictures."""
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [np.where(m.faces >= 0, m.faces + offset, -1) for m, offset in zip(meshes, offsets, strict=False)]
    colour = None
    if any(mesh.colour is not None for mesh in meshes):
        white = [np.ones((len(m.vertices), 3), np.float32) if m.colour is None else m.colour for m in meshes]
        colour = np.concatenate(white)
    scan = Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces).astype(np.int32), colour=colour
    )
    return _with_all_pictures(scan, meshes)


def _with_all_pictures(scan: Mesh, meshes: list[Mesh]) -> Mesh:
    """``scan``, which is ``meshes`` as one, with their pictures, and the colours that those give its vertices."""
    if not any(has_pictures(mesh) for mesh in meshes):
        return scan
    uv, material, pictures = [], [], []
    for mesh in meshes:
        shown = has_pictures(mesh)
        uv.append(mesh.uv if shown else np.zeros((len(mesh.faces), 4, 2), np.float32))
        material.append((mesh.material if shown else np.zeros(len(mesh.faces), np.int16)) + len(pictures))
        pictures += mesh.pictures if shown else (None,)
    uv, material = np.concatenate(uv), np.concatenate(material).astype(np.int16)
    scan = replace(scan, uv=uv, material=material, pictures=tuple(pictures))
    return replace(scan, colour=vertex_colours(scan))
