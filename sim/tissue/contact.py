# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact: fascia on skull (Lee, Terzopoulos and Waters 1995, 3.7), lids on eyeball, lips on teeth and lips on lips.

3.7 cancels the part of the force that points into the skull, so that tissue slides over bone. The same follows from a
one-sided spring along the bone's normal, which the solver can minimise. All contacts are points against planes, found
anew every few steps; a plane that the rest shape already crosses is moved back to it, so that the neutral face stays
exactly the scan. `project` finally moves skin out of eyeball and teeth whatever is left.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..anatomy.head import Head
from ..mesh import vertex_normals
from .layers import Layers
from .lids import eyeball_radius

_LIP_REACH = 6.0
_TEETH_REACH = 7.0


@dataclass(frozen=True, eq=False)
class Surfaces:
    """What may touch. mouth (m,) skin columns near teeth or lips; lip_upper, lip_lower: columns of the two lips.

    teeth : part -> (points (k, 3), outward normals (k, 3)) at rest
    """

    mouth: np.ndarray
    lip_upper: np.ndarray
    lip_lower: np.ndarray
    teeth: dict[str, tuple[np.ndarray, np.ndarray]]
    triangles: np.ndarray


@dataclass(frozen=True, eq=False)
class Planes:
    """Active contacts: node (c,), normal (c, 3), level (c,): node · normal must not fall under level.

    partner (c,) node that carries the plane or -1 (then the plane is fixed); offset for partnered ones.
    """

    node: np.ndarray
    normal: np.ndarray
    level: np.ndarray
    partner: np.ndarray


def build_surfaces(head: Head, layers: Layers) -> Surfaces:
    """The contact surfaces of ``head``."""
    n = len(layers.area)
    free = layers.free[:n]
    zero = np.zeros(n)
    groups = head.groups
    lip_u, lip_l, bag = (np.asarray(groups.get(k, zero)) for k in ("lip_upper", "lip_lower", "mouth_bag"))
    teeth = {}
    skin = head.skin.vertices
    near = np.zeros(n, bool)
    for part in ("teeth_upper", "teeth_lower"):
        mesh = head.parts.get(part)
        if mesh is None or not len(mesh.vertices):
            continue
        tri = mesh.triangles
        a, b, c = (mesh.vertices[tri[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        size = np.linalg.norm(normal, axis=1)
        good = size > 1e-6
        points, normal = ((a + b + c) / 3)[good], normal[good] / size[good, None]
        # only what faces the lips and cheeks pushes: outward of the dental arch
        centre = mesh.vertices.mean(axis=0) + [0, 12, 0]
        radial = points - centre
        radial[:, 2] = 0
        radial /= np.maximum(np.linalg.norm(radial, axis=1, keepdims=True), 1e-9)
        outer = np.einsum("ij,ij->i", radial, normal) > 0.3
        if outer.sum() < 4:
            continue
        points, radial = points[outer], radial[outer]
        smooth = radial + normal[outer]
        teeth[part] = points, smooth / np.linalg.norm(smooth, axis=1, keepdims=True)
        near |= cKDTree(points).query(skin)[0] < 14
    mouth = np.flatnonzero(near & free & ((lip_u > 0.2) | (lip_l > 0.2) | (bag > 0.2)))
    return Surfaces(
        mouth, np.flatnonzero((lip_u > 0.3) & free), np.flatnonzero((lip_l > 0.3) & free), teeth, head.skin.triangles
    )


def bone_planes(layers: Layers, bone: np.ndarray, mandible_rotation: np.ndarray, rest_margin: np.ndarray) -> Planes:
    """Fascia over bone: planes at the posed bone nodes ``bone`` (n, 3), their normals turned with the mandible."""
    n = len(layers.area)
    column = np.flatnonzero(layers.bony & layers.free[:n])
    normal = layers.bone_normal[column]
    turned = normal @ mandible_rotation.T
    w = layers.mandible[column, None]
    normal = (1 - w) * normal + w * turned
    level = np.einsum("ij,ij->i", bone[column], normal) + rest_margin[column]
    return Planes(column + n, normal, level, np.full(len(column), -1))


def bone_margin(layers: Layers) -> np.ndarray:
    """(n,) mm that fascia must keep over its bone: 0.3 or what the rest shape has."""
    n = len(layers.area)
    gap = np.einsum("ij,ij->i", layers.nodes[n : 2 * n] - layers.nodes[2 * n :], layers.bone_normal)
    return np.minimum(gap, 0.3)


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


def teeth_contacts(surfaces: Surfaces, positions, reference, rotation, translation) -> Planes:
    """Lips and mouth bag against the outer faces of the teeth; ``reference``: skin at rest (its own clearance)."""
    node, normal, level = [], [], []
    column = surfaces.mouth
    if not len(column):
        return empty_planes()
    for part, (points, outward) in surfaces.teeth.items():
        lower = part == "teeth_lower"
        here = points @ rotation.T + translation if lower else points
        facing = outward @ rotation.T if lower else outward
        distance, near = cKDTree(here).query(positions[column])
        # the clearance at rest is measured against the same tooth, so a scan whose lip dips into a tooth stays put
        rest_gap = np.einsum("ij,ij->i", reference[column] - points[near], outward[near])
        gap = np.einsum("ij,ij->i", positions[column] - here[near], facing[near])
        keep = (distance < _TEETH_REACH) & (gap > -5.0)
        node.append(column[keep])
        normal.append(facing[near][keep])
        clearance = np.minimum(rest_gap[keep], 0.25)
        level.append(np.einsum("ij,ij->i", here[near][keep], facing[near][keep]) + clearance)
    node, normal, level = (np.concatenate(x) for x in (node, normal, level))
    return Planes(node, normal, level, np.full(len(node), -1))


def lip_contacts(surfaces: Surfaces, positions, reference) -> Planes:
    """Upper lip against lower lip, each lower vertex against the tangent plane of its nearest upper vertex."""
    upper, lower = surfaces.lip_upper, surfaces.lip_lower
    if len(upper) < 3 or len(lower) < 3:
        return empty_planes()
    skin = positions[: len(reference)]
    normals = vertex_normals(skin, surfaces.triangles)
    rest_normals = vertex_normals(reference, surfaces.triangles)
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
        level.append(np.minimum(rest_gap[keep], 0.05))
    return Planes(*(np.concatenate(x) for x in (node, normal, level, partner)))


def empty_planes() -> Planes:
    """No contact."""
    return Planes(np.zeros(0, int), np.zeros((0, 3)), np.zeros(0), np.zeros(0, int))


def joined(*planes: Planes) -> Planes:
    """All of them in one table."""
    return Planes(*(np.concatenate([getattr(p, f) for p in planes]) for f in ("node", "normal", "level", "partner")))


def depths(planes: Planes, positions: np.ndarray) -> np.ndarray:
    """(c,) mm of penetration, 0 where apart."""
    here = np.einsum("ij,ij->i", positions[planes.node], planes.normal)
    paired = planes.partner >= 0
    if paired.any():
        here[paired] -= np.einsum("ij,ij->i", positions[planes.partner[paired]], planes.normal[paired])
    return np.maximum(planes.level - here, 0)


def contact_energy(planes: Planes, positions: np.ndarray, stiffness: float) -> tuple[float, np.ndarray]:
    """Energy ½ k Σ depth² and its gradient over all nodes."""
    depth = depths(planes, positions)
    gradient = np.zeros_like(positions)
    hit = np.flatnonzero(depth > 0)
    if not len(hit):
        return 0.0, gradient
    push = -stiffness * depth[hit, None] * planes.normal[hit]
    pair = planes.partner[hit]
    for axis in range(3):
        gradient[:, axis] += np.bincount(planes.node[hit], push[:, axis], minlength=len(positions))
        both = pair >= 0
        if both.any():
            gradient[:, axis] -= np.bincount(pair[both], push[both, axis], minlength=len(positions))
    return 0.5 * stiffness * float(depth @ depth), gradient


def project(planes: Planes, positions: np.ndarray, rounds: int = 2) -> np.ndarray:
    """Positions with what is left of penetration removed; partners share the way."""
    out = positions.copy()
    for _ in range(rounds):
        depth = depths(planes, out)
        hit = np.flatnonzero(depth > 1e-6)
        if not len(hit):
            break
        pair = planes.partner[hit]
        part = np.where(pair >= 0, 0.5, 1.0)
        push = (part * depth[hit])[:, None] * planes.normal[hit]
        both = pair >= 0
        nodes = np.concatenate([planes.node[hit], pair[both]])
        moves = np.concatenate([push, -push[both]])
        count = np.bincount(nodes, minlength=len(out))
        for axis in range(3):
            out[:, axis] += np.bincount(nodes, moves[:, axis], minlength=len(out)) / np.maximum(count, 1)
    return out
