# SPDX-License-Identifier: GPL-3.0-or-later
"""What a contact sheet draws of a head: `picture.Layer` of skin, parts, bones and muscles."""

import colorsys

import numpy as np

from ...sim.anatomy.head import MATERIALS, Head
from ...sim.mesh import Mesh, edges
from ...sim.mesh_subdivision import limit, subdivision
from .muscles import rows
from .picture import Layer

TENDON = np.array([0.86, 0.78, 0.70])
CONJUNCTIVA = np.array([0.79, 0.50, 0.46])
LIP, LINING = np.array([0.74, 0.40, 0.37]), np.array([0.55, 0.22, 0.21])
SKIN, BONE, JAW = np.array([0.84, 0.64, 0.54]), np.array([0.88, 0.84, 0.74]), np.array([0.70, 0.78, 0.88])

#: Colour of each material name (`sim.anatomy.head.MATERIALS`).
COLOURS = {
    "enamel": (0.93, 0.91, 0.84),
    "gum": (0.78, 0.42, 0.42),
    "tongue": (0.76, 0.38, 0.38),
    "bone": BONE,
    "sclera": (0.88, 0.86, 0.84),
    "iris": (0.36, 0.26, 0.16),
    "pupil": (0.015, 0.015, 0.015),
    "cornea": (0.55, 0.56, 0.58),
    "caruncle": (0.80, 0.50, 0.47),
}

#: Wet things are glossier than others; iris and pupil lie behind the cornea and are dull.
GLOSS = {"iris": 0.02, "pupil": 0.0}


def skin_layer(mesh: Mesh, wire: bool = False, levels: int = 2, groups: dict | None = None) -> Layer:
    """The skin's limit surface, with the edges of the cage drawn on it for ``wire``.

    groups : the head's, for red lips and lid backs
    """
    n = len(mesh.vertices)
    operator, quads, _ = subdivision(mesh.faces, n, levels)
    operator = limit(quads, operator.shape[0]) @ operator
    smooth = operator @ mesh.vertices
    lines = smooth[_cage_lines(mesh.faces, n, levels)] if wire else None
    colour, gloss = SKIN, 0.12
    if groups is not None:
        lip = np.clip((operator @ np.maximum(groups["lip_upper"], groups["lip_lower"]) - 0.7) / 0.25 + 0.5, 0, 1)
        colour = SKIN + lip[:, None] * (LIP - SKIN)
        colour = colour + np.clip(operator @ groups["mouth_bag"], 0, 1)[:, None] * (LINING - colour)
        lids = np.max([groups[f"lid_{lid}_{side}"] for lid in ("upper", "lower") for side in "lr"], axis=0)
        wet = np.clip((operator @ (groups["inner"] * (lids > 0)) - 0.02) / 0.2, 0, 1)
        colour = colour + wet[:, None] * (CONJUNCTIVA - colour)
        gloss = 0.12 + 0.6 * wet
    return Layer(smooth, Mesh(smooth, quads).triangles, colour, lines, gloss=gloss)


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
    gloss = np.full(len(mesh.vertices), 0.25)
    for name, amount in GLOSS.items():
        if name in names:
            gloss[mesh.faces[material == names.index(name)].clip(min=0)] = amount
    return Layer(mesh.vertices, Mesh(mesh.vertices, faces).triangles, colour, gloss=gloss, polish=90.0)


def eye_layers(head: Head) -> list[Layer]:
    """Both eyeballs, and the corneas as glass before them."""
    return [part_layer(head, f"eye_{side}") for side in "lr"] + [cornea_layer(head, side) for side in "lr"]


def cornea_layer(head: Head, side: str) -> Layer:
    """The clear cornea of one eye: little but its highlight."""
    mesh = head.parts[f"eye_{side}"]
    faces = mesh.faces[mesh.material == MATERIALS[f"eye_{side}"].index("cornea")]
    colour = np.array(COLOURS["cornea"])
    return Layer(mesh.vertices, Mesh(mesh.vertices, faces).triangles, colour, gloss=0.9, polish=400.0, cover=0.02)


def mouth_layers(head: Head) -> list[Layer]:
    """Teeth with gums above and below, and the tongue."""
    return [part_layer(head, name) for name in ("teeth_upper", "teeth_lower", "tongue")]


def bone_layers(head: Head) -> list[Layer]:
    """Skull and mandible."""
    return [part_layer(head, "skull", BONE), part_layer(head, "mandible", JAW)]


def muscle_layers(head: Head, least: float = 0.0) -> list[Layer]:
    """Every belly in a red of its layer, paler toward its tendons, with its fibres as lines.

    ``least`` leaves out the muscles above that level of the table (0 draws all; 2 only those deeper than 2).
    """
    level = {row["name"]: float(row["level"]) for row in rows()}
    layers = []
    for muscle in head.muscles:
        base = muscle.name.removesuffix("_l").removesuffix("_r")
        if least and level[base] >= least:
            continue
        kin = sum(map(ord, base.split("_")[0]))  # parts of one muscle look alike
        hue = 0.012 + 0.004 * (kin % 5)
        value = 0.60 + 0.035 * level[base] + 0.02 * (kin % 3)
        belly = np.array(colorsys.hsv_to_rgb(hue, 0.66 - 0.02 * level[base], value))
        around = 4 * len(muscle.fibres) - 4
        vertices = muscle.shape.vertices
        rings = vertices.reshape(-1, around, 3)
        along = np.linspace(0, 1, len(rings))
        pale = np.zeros_like(along) if muscle.ring else 0.75 * np.clip(1 - along / 0.14, 0, 1)
        if not muscle.ring and muscle.insertion != "soft":
            pale = np.maximum(pale, 0.75 * np.clip(1 - (1 - along) / 0.14, 0, 1))
        colour = np.repeat(belly + pale[:, None] * (TENDON - belly), around, axis=0)
        strands = np.stack([rings, 0.5 * (rings + np.roll(rings, -1, axis=1))], axis=2).reshape(len(rings), -1, 3)
        nearer = np.roll(strands, -1, axis=0) if muscle.ring else strands[1:]
        lines = np.stack([strands[: len(nearer)], nearer], axis=2).reshape(-1, 2, 3)
        layers.append(Layer(vertices, muscle.shape.triangles, colour, lines, belly * 0.72, gloss=0.18, ink_share=0.3))
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
