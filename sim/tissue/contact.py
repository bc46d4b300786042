# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact of the layers' own nodes: fascia on skull (Lee, Terzopoulos and Waters 1995, 3.7), lids on eyeball, lips on lips.

3.7 cancels the part of the force that points into the skull, so that tissue slides over bone. The same follows from a
one-sided spring along the bone's normal, which the solver can minimise. All contacts are points against planes, found
anew every few steps; a plane that the rest shape already crosses is moved back to it, so that the neutral face stays
exactly the scan. Our own model takes bone and lining from here, and looks for the rest on the surface that is drawn
(`drawn_contact`); the other models know vertices only.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from ..anatomy.head import Head
from ..mesh import vertex_normals
from .arch import Arch, build_arches
from .eye_surface import eyeball_radius
from .geometry import TIE, short_diagonals
from .layers import Layers
from .planes import Planes, empty_planes

_LIP_REACH = 6.0
#: mm farther away for which a point of bone makes up by facing the way that a column stands, not 60 degrees off it; mm, of
#: both together, beyond which fascia is not held off bone: more than it moves before bone is looked for again.
_FACING, _BONE_REACH = 12.0, 16.0
#: mm over bone from which on fascia may come to touch it within a frame.
NEAR_BONE = 1.5


@dataclass(frozen=True, eq=False)
class Bone:
    """column (c,) skin columns on this bone, margin (c,) mm their fascia keeps; points, normal (k, 3); tree of
    points and normals times `_FACING`."""

    column: np.ndarray
    margin: np.ndarray
    points: np.ndarray
    normal: np.ndarray
    tree: cKDTree
    lower: bool

    def under(self, points, stands, reach: float = np.inf):
        """Which (r,) of ``points`` (c, 3) have bone under them, its place (r, 3) and normal (r, 3) there: near, and facing
        about as ``stands`` (c, 3), the way the column stands on it; off by no more than ``reach``, both as mm in `_FACING`.
        So what gets into the bone goes out by the side it came from, not through the bone."""
        distance, near = self.tree.query(np.concatenate([points, _FACING * stands], axis=1), distance_upper_bound=reach)
        rows = np.flatnonzero(np.isfinite(distance))
        at, normal = self.points[near[rows]], self.normal[near[rows]]
        middle = np.abs(points[rows, 0]) < TIE  # two places are as near, and it is held to neither side
        at[middle, 0] = normal[middle, 0] = 0
        return rows, at, normal


@dataclass(frozen=True, eq=False)
class Surfaces:
    """What may touch. arches: the dental arches; lip_upper, lip_lower: columns of the two lips.

    sheets (p, 2), sheet_gap (p,): columns of inner and outer skin back to back and mm between them at rest
    """

    arches: tuple[Arch, ...]
    bones: tuple[Bone, ...]
    lip_upper: np.ndarray
    lip_lower: np.ndarray
    sheets: np.ndarray
    sheet_gap: np.ndarray
    triangles: np.ndarray


def build_surfaces(head: Head, layers: Layers, ties: np.ndarray) -> Surfaces:
    """The contact surfaces of ``head``; ties (p, 2): columns back to back (`layers.sheet_ties`)."""
    n = len(layers.area)
    free = layers.free[:n]
    zero = np.zeros(n)
    lip_u, lip_l = (np.asarray(head.groups.get(k, zero)) for k in ("lip_upper", "lip_lower"))
    skin = head.skin.vertices
    apart = np.einsum(
        "ij,ij->i",
        skin[ties[:, 1]] - skin[ties[:, 0]],
        vertex_normals(skin, short_diagonals(head.skin.vertices, head.skin.faces))[ties[:, 1]],
    )
    return Surfaces(
        arches=build_arches(head, layers),
        bones=build_bones(head, layers),
        lip_upper=np.flatnonzero((lip_u > 0.3) & free),
        lip_lower=np.flatnonzero((lip_l > 0.3) & free),
        sheets=ties[apart > 0.1],
        sheet_gap=apart[apart > 0.1],
        triangles=short_diagonals(head.skin.vertices, head.skin.faces),
    )


def bone_planes(model_bones, layers: Layers, fascia: np.ndarray, rotation, translation, nearby=None) -> Planes:
    """Fascia (n, 3) over bone (3.7): the tangent plane of the bone where each node is now, so that it slides along it.

    The mandible's columns are looked up in the mandible's own frame. Where the nearest bone faces another way than the
    bone the column stands on (the inside of an orbit, the edge of a plate) there is no contact.

    nearby : `Nearby`; with it, only what is within `NEAR_BONE` mm counts
    """
    node, normal, level = [], [], []
    for bone in model_bones:
        points = fascia[bone.column]
        if bone.lower:
            points = (points - translation) @ rotation
        due = slice(None) if nearby is None else nearby.due(bone, points)
        stands, column, points_due = layers.bone_normal[bone.column[due]], bone.column[due], points[due]
        rows, at, n = bone.under(points_due, stands, _BONE_REACH)
        keep = np.einsum("ij,ij->i", n, stands[rows]) > 0.5
        if nearby is not None:
            height = np.einsum("ij,ij->i", points_due[rows] - at, n) - bone.margin[due][rows]
            room = np.full(len(points_due), NEAR_BONE)  # where there is no contact as it is now
            room[rows[keep]] = height[keep] - NEAR_BONE
            nearby.seen(bone, due, points, room)
            keep &= height < NEAR_BONE
        rows, at, n = rows[keep], at[keep], n[keep]
        if bone.lower:
            at, n = at @ rotation.T + translation, n @ rotation.T
        node.append(column[rows] + len(fascia))
        normal.append(n)
        level.append(np.einsum("ij,ij->i", at, n) + bone.margin[due][rows])
    if not node:
        return empty_planes()
    node, normal, level = (np.concatenate(x) for x in (node, normal, level))
    return Planes(node, normal, level, np.full(len(node), -1))


def build_bones(head: Head, layers: Layers) -> tuple[Bone, ...]:
    """Skull and mandible as point samples with outward normals, and the columns that stand on them."""
    n = len(layers.area)
    bones = []
    for lower, part in ((False, "skull"), (True, "mandible")):
        column = np.flatnonzero(layers.bony & layers.free[:n] & ((layers.mandible > 0.5) == lower))
        if not len(column):
            continue
        mesh = head.parts[part]
        tri = short_diagonals(mesh.vertices, mesh.faces)
        at_vertex = vertex_normals(mesh.vertices, tri)
        points = np.concatenate([mesh.vertices, mesh.vertices[tri].mean(axis=1)])
        normal = np.concatenate([at_vertex, at_vertex[tri].mean(axis=1)])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        near = cKDTree(points).query(layers.nodes[2 * n :][column])[1]
        if np.einsum("ij,ij->i", normal[near], layers.bone_normal[column]).mean() < 0:  # wound inside out
            normal = -normal
        tree = cKDTree(np.concatenate([points, _FACING * normal], axis=1))
        bone = Bone(column, np.zeros(len(column)), points, normal, tree, lower)
        fascia = layers.nodes[n : 2 * n][column]
        _, at, facing = bone.under(fascia, layers.bone_normal[column])
        gap = np.einsum("ij,ij->i", fascia - at, facing)
        bones.append(replace(bone, margin=np.minimum(gap, 0.3)))
    return tuple(bones)


def eye_planes(lids, positions: np.ndarray, gaze: np.ndarray) -> Planes:
    """Skin round an eye against the eyeball."""
    column = lids.contact_column
    rel = positions[column] - lids.eye.centre
    size = np.maximum(np.linalg.norm(rel, axis=1, keepdims=True), 1e-9)
    normal = rel / size
    need = eyeball_radius(lids, positions[column], gaze) + lids.clearance
    near = size[:, 0] < need + 2.0
    level = (normal @ lids.eye.centre + need)[near]
    return Planes(column[near], normal[near], level, np.full(int(near.sum()), -1))


def sheet_contacts(surfaces: Surfaces, normals) -> Planes:
    """Mouth bag and outer skin back to back: the outer one stays outside by a third of their gap at rest.

    normals (n, 3) of the skin as it is now."""
    inner, outer = surfaces.sheets[:, 0], surfaces.sheets[:, 1]
    return Planes(outer, normals[outer], 0.35 * surfaces.sheet_gap, inner)


def lip_contacts(surfaces: Surfaces, skin, normals, reference, rest_normals) -> Planes:
    """Upper lip against lower lip, each vertex against the tangent plane of the nearest one of the other lip.

    skin, normals (n, 3) as they are now; reference, rest_normals (n, 3) at rest
    """
    upper, lower = surfaces.lip_upper, surfaces.lip_lower
    if len(upper) < 3 or len(lower) < 3:
        return empty_planes()
    node, partner, normal, level = [], [], [], []
    for own, other in ((lower, upper), (upper, lower)):
        distance, near = cKDTree(skin[other]).query(skin[own])
        mate = other[near]
        facing = normals[mate] - normals[own]
        size = np.linalg.norm(facing, axis=1)
        facing = facing / np.maximum(size, 1e-9)[:, None]
        opposed = np.einsum("ij,ij->i", normals[mate], normals[own]) < 0.0
        rest_facing = rest_normals[mate] - rest_normals[own]
        rest_facing /= np.maximum(np.linalg.norm(rest_facing, axis=1, keepdims=True), 1e-9)
        rest_gap = np.einsum("ij,ij->i", reference[own] - reference[mate], rest_facing)
        keep = opposed & (distance < _LIP_REACH) & (size > 0.5)
        node.append(own[keep])
        partner.append(mate[keep])
        normal.append(facing[keep])
        level.append(np.minimum(rest_gap[keep], 0.4))
    return Planes(*(np.concatenate(x) for x in (node, normal, level, partner)))
