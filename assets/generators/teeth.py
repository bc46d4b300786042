# SPDX-License-Identifier: GPL-3.0-or-later
"""Two rows of sixteen teeth with their gums, placed behind the closed lips inside the mouth."""

import numpy as np

from ...sim.mesh import Mesh
from .mouth_room import MouthRoom
from .teeth_gum import gum
from .teeth_places import mirrored, tooth_places
from .teeth_shape import tooth_mesh


def make_teeth(skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray]) -> tuple[Mesh, Mesh]:
    """(upper, lower) teeth with gums; materials index `MATERIALS["teeth_upper"]` (enamel, gum).

    Every tooth and the gum of a jaw are closed pieces of their own. Crowns and gums lie in the mouth bag, roots go
    through its lining into the bone.
    """
    room = MouthRoom(skin, groups, landmarks)
    places = tooth_places(skin, groups, landmarks)
    return _row(places["upper"], +1, room), _row(places["lower"], -1, room)


def incisor_edge(teeth_lower: Mesh) -> np.ndarray:
    """(3,) mm, the point between the biting edges of the lower middle incisors."""
    enamel = np.unique(teeth_lower.faces[teeth_lower.material == 0][:, :3])
    near = teeth_lower.vertices[enamel]
    near = near[np.abs(near[:, 0]) < 4.0]
    edge = near[near[:, 2] > near[:, 2].max() - 0.6].mean(axis=0)
    return edge * [0, 1, 1]


def _row(places, rise, room):
    pieces = []
    for place in places:
        for each in (place, mirrored(place)):
            vertices, faces = tooth_mesh(place.tooth)
            if np.linalg.det(each.axes) < 0:
                faces = np.where(faces[:, 3:] >= 0, faces[:, [0, 3, 2, 1]], faces[:, [0, 2, 1, 3]])
            pieces.append((vertices @ each.axes + each.neck, faces, 0))
    pieces.append((*gum(places, rise, room), 1))
    start = np.cumsum([0] + [len(v) for v, _, _ in pieces])
    faces = [np.where(f >= 0, f + s, -1) for (_, f, _), s in zip(pieces, start[:-1], strict=True)]
    material = [np.full(len(f), kind, np.int16) for _, f, kind in pieces]
    return Mesh(
        np.concatenate([v for v, _, _ in pieces]),
        np.concatenate(faces).astype(np.int32),
        material=np.concatenate(material),
    )
