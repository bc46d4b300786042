# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the faces of a PLY file lie on its pictures: the columns that several programs write for it."""

import numpy as np

from ..errors import InputError

#: Names of a vertex's coordinates: Blender, Cura and trimesh; others; MeshLab and RealityCapture.
_OF_VERTICES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
_OF_FACES, _NUMBER = "texcoord", "texnumber"


def corner_places(vertex, face, counts, corners, polygon, faces, pictures: int, path):
    """Texture coordinates (m, 4, 2) float32 and picture (m,) int16 of the ``faces`` (m, 4); (None, None): the file has no
    coordinates.

    vertex, face : columns of these elements, those of ``vertex`` without lists
    counts (p,) : corners of the file's polygons; corners (m, 4) : which of all those in a row are each face's, -1 : none
    polygon (m,) : which each face was made of
    pictures : how many are named, which is also the picture of a face that shows none: it has no coordinates, or the
    number (``texnumber``) of no picture

    Lists of ``texcoord`` in faces come before coordinates of vertices.

    Raises
    ------
    InputError : a polygon has coordinates, but not for each of its corners.
    """
    if isinstance(face.get(_OF_FACES), tuple):
        lengths, flat = face[_OF_FACES]
        if ((lengths != 2 * counts) & (lengths != 0)).any():
            raise InputError(
                f"{path} is damaged, a face has texture coordinates for more or fewer corners than it has: export the scan "
                "again."
            )
        shown = lengths[polygon] > 0
        # how many coordinates the list of a polygon begins behind what it would if all had one
        missing = np.cumsum(2 * counts - lengths)[polygon]
        at = np.where(shown[:, None] & (corners >= 0), 2 * corners - missing[:, None], 0)
        uv = np.append(flat, [0, 0])[at[..., None] + [0, 1]]
    else:
        names = next((pair for pair in _OF_VERTICES if all(name in vertex for name in pair)), None)
        if names is None:
            return None, None
        shown = np.ones(len(faces), dtype=bool)
        uv = np.stack([vertex[name] for name in names], axis=1)[faces]
    with np.errstate(over="ignore", invalid="ignore"):
        uv = np.where((corners >= 0)[..., None], uv, 0).astype(np.float32)
    number = np.zeros(len(faces))
    if _NUMBER in face and not isinstance(face[_NUMBER], tuple):
        number = np.asarray(face[_NUMBER], dtype=float)[polygon]
    elif _NUMBER in vertex:
        number = np.asarray(vertex[_NUMBER], dtype=float)[faces[:, 0]]
    shown &= np.isfinite(uv).all(axis=(1, 2)) & (number >= 0) & (number < pictures)
    uv[~shown] = 0
    return uv, np.where(shown, number, pictures).astype(np.int16)
