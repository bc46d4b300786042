# SPDX-License-Identifier: GPL-3.0-or-later
"""The tongue at rest: tip behind the lower incisors, domed back with its median groove, root going down and back."""

import numpy as np
from scipy.ndimage import gaussian_filter, gaussian_filter1d, minimum_filter
from scipy.spatial import cKDTree

from ...sim.mesh import Mesh
from .mouth_lining import MouthLining
from .mouth_room import MouthRoom
from .skull_field import curve
from .teeth_shape import tube_faces

AROUND, ALONG = 20, 20

#: Middle line of the upper side and of the underside, tip to root: share of the way back, mm over the line of the lips.
TOP = ((0.0, -3.3), (0.02, -1.7), (0.07, -0.3), (0.16, 1.4), (0.32, 4.0), (0.5, 6.6), (0.68, 7.4), (0.84, 6.0),
       (0.95, 2.6), (1, -2.5))  # fmt: skip
UNDER = ((0.0, -4.7), (0.02, -6.2), (0.07, -7.8), (0.15, -9.4), (0.25, -12.5), (0.38, -15.5), (0.52, -16.8), (0.68, -17),
         (0.8, -16.5), (0.9, -14.5))  # fmt: skip
#: mm kept to teeth and gums, to the roof of the mouth, to its floor and walls.
BESIDE, ABOVE, CLEAR = 0.9, 2.2, 0.8
#: How far the tongue may be drawn in where it lacks room.
SHARES = np.linspace(1.0, 0.4, 13)


def make_tongue(
    skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray], teeth_upper: Mesh, teeth_lower: Mesh
) -> Mesh:
    """The tongue's mesh of quads, within the rows of teeth and the lining of the mouth, mm."""
    room = MouthRoom(skin, groups, landmarks)
    teeth = np.concatenate([_enamel(teeth_upper), teeth_lower.vertices])
    teeth = teeth[np.abs(teeth[:, 2] - room.line) < 10]
    front = teeth[(np.abs(teeth[:, 0]) < 3) & (teeth[:, 2] < room.line - 1), 1].max() + 1.2
    back = room.back - 10.0
    top, under = (curve(np.array(line), ALONG) for line in (TOP, UNDER))
    turn = np.linspace(-np.pi / 2, np.pi / 2, AROUND // 2 + 1)  # left half, from under the tongue to its back
    side, up = np.cos(turn), np.sin(turn)
    rings = np.zeros((ALONG, len(turn), 3))
    rise = 0.5 + 0.5 * np.sign(up) * np.abs(up) ** 0.9
    for axis, scale, start in ((1, back - front, front), (2, 1.0, room.line)):
        line = [start + scale * each[:, axis - 1] for each in (under, top)]
        rings[..., axis] = line[0][:, None] * (1 - rise) + line[1][:, None] * rise
    plan = rings[..., :2].reshape(-1, 2)
    roof, floor = (room.limit(plan, way).reshape(rings.shape[:2]) for way in (1, -1))
    rings[..., 2] = np.maximum(np.minimum(rings[..., 2], roof - ABOVE), floor + CLEAR)
    way = (rings[:, :, 1].mean(axis=1) - front)[:, None]
    tip = 19.0 * np.sqrt(np.clip(1 - (1 - (way + 1.4) / 14) ** 2, 0.02, 1))
    wide = np.minimum(_half_width(teeth, rings[..., 1]), np.where(way < 12, tip, np.inf))
    share = np.linspace(0, 1, ALONG)[:, None]
    wide = wide * np.interp(share, [0, 0.85, 1], [1, 1, 0.8])
    rings[..., 0] = wide * side**0.75 * np.where(up < 0, 1 - 0.35 * up**2 * np.interp(share, [0, 0.3], [0, 1]), 1.0)
    rings[..., 2] -= 1.6 * np.exp(-((rings[..., 0] / 2.6) ** 2)) * (up > 0.3) * np.sin(np.pi * share) ** 0.7
    points = _shrunk(rings, MouthLining(skin, groups), np.concatenate([teeth_upper.vertices, teeth_lower.vertices]))
    points[:, [0, -1], 0] = 0.0
    whole = np.concatenate([points, points[:, -2:0:-1] * [-1, 1, 1]], axis=1)
    whole = np.roll(whole, -(AROUND // 4), axis=1)  # the closing strips run from the upper side to the underside
    faces = tube_faces(ALONG, AROUND)
    mesh = Mesh(whole.reshape(-1, 3), faces)
    corner = mesh.vertices[mesh.triangles] - mesh.vertices.mean(axis=0)
    if np.einsum("ij,ij->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) < 0:
        faces = np.where(faces[:, 3:] >= 0, faces[:, [0, 3, 2, 1]], faces[:, [0, 2, 1, 3]])
    return Mesh(mesh.vertices, faces, material=np.zeros(len(faces), np.int16))


def _shrunk(rings, lining, teeth):
    """``rings`` (along, half around, 3) drawn in toward their middles until all is clear of lining and teeth."""
    middle = 0.5 * (rings[:, :1] + rings[:, -1:]) * [0, 1, 1]
    tree, size = cKDTree(teeth), np.full(rings.shape[:2], SHARES[-1])
    for share in SHARES[::-1]:
        at = (middle + share * (rings - middle)).reshape(-1, 3)
        free = (lining.depth(at) < -CLEAR) & (tree.query(at)[0] > BESIDE)
        size = np.where(free.reshape(size.shape), share, size)
    size = gaussian_filter(minimum_filter(size, (3, 3), mode="nearest"), (0.8, 0.8), mode="nearest")
    return middle + size[..., None] * (rings - middle)


def _enamel(mesh):
    return mesh.vertices[np.unique(mesh.faces[mesh.material == 0][:, :3])]


def _half_width(teeth, y):
    """Half the free width between the teeth at depths ``y`` (any shape), mm."""
    at = np.linspace(teeth[:, 1].min(), teeth[:, 1].max(), 60)
    inner = []
    for each in at:
        near = np.abs(teeth[np.abs(teeth[:, 1] - each) < 0.9, 0])
        inner.append(near[near > 2].min(initial=40.0))
    inner = np.minimum.accumulate(np.array(inner)[::-1])[::-1]
    return np.interp(y, at, gaussian_filter1d(inner, 2.0, mode="nearest")) - BESIDE
