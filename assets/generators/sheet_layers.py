# SPDX-License-Identifier: GPL-3.0-or-later
"""What a contact sheet draws of a head: `picture.Layer` of skin, parts, bones and muscles."""

import colorsys

import numpy as np

from ...sim.anatomy.head import MATERIALS, Head
from ...sim.mesh import Mesh, edges
from ...sim.mesh_subdivision import limit, subdivision
from .picture import Layer

LIP, LINING = np.array([0.74, 0.40, 0.37]), np.array([0.55, 0.22, 0.21])
SKIN, BONE, JAW = np.array([0.84, 0.64, 0.54]), np.array([0.88, 0.84, 0.74]), np.array([0.70, 0.78, 0.88])

#: Colour of each material name (`sim.anatomy.head.MATERIALS`).
COLOURS = {
    "enamel": (0.93, 0.91, 0.84),
    "gum": (0.78, 0.42, 0.42),
    "tongue": (0.76, 0.38, 0.38),
    "bone": BONE,
    "sclera": (0.93, 0.91, 0.89),
    "iris": (0.36, 0.26, 0.16),
    "pupil": (0.02, 0.02, 0.02),
    "cornea": (0.9, 0.95, 1.0),
    "caruncle": (0.85, 0.5, 0.48),
}


def skin_layer(mesh: Mesh, wire: bool = False, levels: int = 2, groups: dict | None = None) -> Layer:
    """The skin's limit surface, with the edges of the cage drawn on it for ``wire``; lips red where groups are given."""
    n = len(mesh.vertices)
    operator, quads, _ = subdivision(mesh.faces, n, levels)
    operator = limit(quads, operator.shape[0]) @ operator
    smooth = operator @ mesh.vertices
    lines = smooth[_cage_lines(mesh.faces, n, levels)] if wire else None
    colour = SKIN
    if groups is not None:
        lip = np.clip((operator @ np.maximum(groups["lip_upper"], groups["lip_lower"]) - 0.7) / 0.25 + 0.5, 0, 1)
        colour = SKIN + lip[:, None] * (LIP - SKIN)
        colour = colour + np.clip(operator @ groups["mouth_bag"], 0, 1)[:, None] * (LINING - colour)
    return Layer(smooth, Mesh(smooth, quads).triangles, colour, lines)


def _cage_lines(faces: np.ndarray, n: int, levels: int) -> np.ndarray:
    """(l, 2) vertex pairs of the subdivided mesh that descend from the cage's edges."""
    pairs = edges(faces).astype(np.int64)
    for _ in range(levels):
        known = edges(faces).astype(np.int64)
        middle = n + np.searchsorted(known[:, 0] * (n + 1) + known[:, 1], pairs[:, 0] * (n + 1) + pairs[:, 1])
        operator, faces, _ = subdivision(faces, n, 1)
        pairs = np.sort(np.concatenate([np.stack([pairs[:, k], middle], axis=1) for k in (0, 1)]), axis=1)
        n = operator.shape[0]
    return pairs


def part_layer(head: Head, part: str, colour=None) -> Layer:
    """A part in the colours of its materials, or in one ``colour``; corneas are left out, being clear."""
    mesh, names = head.parts[part], MATERIALS[part]
    material = np.zeros(len(mesh.faces), dtype=int) if mesh.material is None else mesh.material
    keep = np.array([name != "cornea" for name in names])[material]
    faces = mesh.faces[keep]
    tint = np.array([COLOURS[name] for name in names], dtype=float)[material[keep]]
    if colour is None:  # one colour for a vertex, the mean over its faces: split vertices would lose the smooth shading
        corner = faces >= 0
        of, n = np.repeat(np.arange(len(faces)), corner.sum(axis=1)), len(mesh.vertices)
        count = np.maximum(np.bincount(faces[corner], minlength=n), 1)
        colour = np.stack([np.bincount(faces[corner], tint[of, k], minlength=n) / count for k in range(3)], axis=1)
    return Layer(mesh.vertices, Mesh(mesh.vertices, faces).triangles, colour, gloss=0.25)


def eye_layers(head: Head) -> list[Layer]:
    """Both eyeballs without their corneas."""
    return [part_layer(head, f"eye_{side}") for side in "lr"]


def mouth_layers(head: Head) -> list[Layer]:
    """Teeth with gums above and below, and the tongue."""
    return [part_layer(head, name) for name in ("teeth_upper", "teeth_lower", "tongue")]


def bone_layers(head: Head) -> list[Layer]:
    """Skull and mandible."""
    return [part_layer(head, "skull", BONE), part_layer(head, "mandible", JAW)]


def muscle_layers(head: Head) -> list[Layer]:
    """Every belly in a colour of its own."""
    layers = []
    for muscle in head.muscles:
        hue = (sum(map(ord, muscle.name.removesuffix("_l").removesuffix("_r"))) * 0.618) % 1
        colour = np.array(colorsys.hsv_to_rgb(hue, 0.55, 0.8)) * 0.6 + np.array([0.7, 0.25, 0.2]) * 0.4
        layers.append(Layer(muscle.shape.vertices, muscle.shape.triangles, colour))
    return layers


def mark_layer(points: np.ndarray, radius: float = 1.4) -> Layer:
    """A small octahedron for each of (k, 3) points."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    faces = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])
    vertices = (points[:, None] + radius * axes).reshape(-1, 3)
    triangles = (faces[None] + 6 * np.arange(len(points))[:, None, None]).reshape(-1, 3)
    return Layer(vertices, triangles, np.array([0.1, 0.45, 0.85]))


def feature_layer(head: Head) -> Layer:
    """The feature mesh with its edges."""
    at = head.landmark_positions()
    points = np.array([at[name] for name in head.landmarks.names])
    pairs = np.concatenate([head.feature_mesh[:, [k, (k + 1) % 3]] for k in range(3)])
    return Layer(points, head.feature_mesh, np.array([0.75, 0.75, 0.72]), points[pairs])


def texture_layer(skin: Mesh, size: float = 200.0) -> Layer:
    """The texture square laid out in the plane y = 0: bluer where a mm of skin has more texels, redder where fewer."""
    corners = skin.uv.astype(float) - 0.5
    flat = size * np.stack([corners[..., 0], np.zeros(corners.shape[:2]), corners[..., 1]], axis=-1)

    def area(quads):
        cross = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
        return 0.5 * np.linalg.norm(cross, axis=1)

    ratio = area(flat) / np.maximum(area(skin.vertices[skin.faces]), 1e-6)
    t = np.clip(0.5 + 0.25 * np.log2(ratio / np.median(ratio)), 0, 1)[:, None]
    colour = np.repeat((1 - t) * [0.9, 0.45, 0.35] + t * [0.4, 0.6, 0.95], 4, axis=0)
    index = np.arange(flat.shape[0] * 4).reshape(-1, 4)
    lines = np.stack([flat, np.roll(flat, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    triangles = np.concatenate([index[:, [0, 1, 2]], index[:, [0, 2, 3]]])
    return Layer(flat.reshape(-1, 3), triangles, colour, lines, gloss=0.0)
