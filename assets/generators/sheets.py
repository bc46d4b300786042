# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact sheets to judge the reference head by: ``python -m headshop.assets.generators.sheets DIR [--head FILE]``.

Each sheet shows one thing from six sides; ``--only skin,mouth`` draws some of them, ``--beside SCAN.ply`` puts a real
head beside the skin. No Blender needed; a sheet takes a few seconds.
"""

import argparse
import colorsys
import sys
from pathlib import Path

import numpy as np

from ...sim.acting.plain_posing import plainly_posed
from ...sim.anatomy.head import Head
from ...sim.anatomy.storage import load_head
from ...sim.mesh import Mesh, edges
from ...sim.mesh_subdivision import limit, subdivision
from ...sim.scan.viewpoint import Viewpoint
from .picture import Layer, draw, montage, write_png

SKIN, BONE, JAW = np.array([0.84, 0.64, 0.54]), np.array([0.88, 0.84, 0.74]), np.array([0.70, 0.78, 0.88])
COLOURS = {
    "enamel": (0.93, 0.91, 0.84), "gum": (0.78, 0.42, 0.42), "tongue": (0.76, 0.38, 0.38), "bone": BONE,
    "sclera": (0.93, 0.91, 0.89), "iris": (0.36, 0.26, 0.16), "pupil": (0.02, 0.02, 0.02), "cornea": (0.9, 0.95, 1.0),
    "caruncle": (0.85, 0.5, 0.48),
}  # fmt: skip

#: yaw, pitch in degrees
SIX = ((0, 0), (40, 5), (90, 0), (145, 8), (25, -38), (20, 45))


def camera(target, yaw, pitch, field, pixels, distance=900.0) -> Viewpoint:
    """A camera around ``target`` (3,) mm whose picture covers ``field`` mm with ``pixels``."""
    return Viewpoint.around(target, np.radians(yaw), np.radians(pitch), distance, field / pixels, field, field)


def skin_layer(mesh: Mesh, wire: bool = False, levels: int = 2) -> Layer:
    """The skin's limit surface, with the edges of the cage drawn on it for ``wire``."""
    n = len(mesh.vertices)
    operator, quads, _ = subdivision(mesh.faces, n, levels)
    smooth = limit(quads, operator.shape[0]) @ (operator @ mesh.vertices)
    lines = None
    if wire:
        lines = smooth[_cage_lines(mesh.faces, n, levels)]
    return Layer(smooth, Mesh(smooth, quads).triangles, SKIN, lines)


def _cage_lines(faces, n, levels):
    """(l, 2) vertex pairs of the subdivided mesh that descend from the cage's edges."""
    pairs = edges(faces).astype(np.int64)
    for _ in range(levels):
        all_pairs = edges(faces).astype(np.int64)
        span = n + 1
        middle = n + np.searchsorted(all_pairs[:, 0] * span + all_pairs[:, 1], pairs[:, 0] * span + pairs[:, 1])
        operator, faces, _ = subdivision(faces, n, 1)
        pairs = np.concatenate([np.stack([pairs[:, 0], middle], 1), np.stack([middle, pairs[:, 1]], 1)])
        pairs = np.sort(pairs, axis=1)
        n = operator.shape[0]
    return pairs


def part_layer(mesh: Mesh, names: tuple[str, ...], colour=None) -> Layer:
    """A part in the colours of its materials; corneas are left out, being clear."""
    faces, material = mesh.faces, mesh.material
    if material is None:
        material = np.zeros(len(faces), dtype=int)
    keep = np.array([n != "cornea" for n in names])[material]
    faces, material = faces[keep], material[keep]
    corners = np.where(faces < 0, faces[:, :1], faces)
    vertices = mesh.vertices[corners].reshape(-1, 3)  # split per face for sharp colour; normals by welding below
    own = np.array([COLOURS[n] for n in names], dtype=float)[material] if colour is None else colour
    tint = np.repeat(np.broadcast_to(own, (len(faces), 3)), 4, axis=0)
    index = np.arange(len(faces) * 4).reshape(-1, 4)
    triangles = np.concatenate([index[:, [0, 1, 2]], index[faces[:, 3] >= 0][:, [0, 2, 3]]])
    return _coloured(vertices, triangles, tint, corners.ravel(), mesh)


def _coloured(vertices, triangles, tint, origin, mesh):
    """One colour per vertex: the mean over the faces there (split vertices would lose the smooth shading)."""
    n = len(mesh.vertices)
    count = np.bincount(origin, minlength=n)
    colour = (
        np.stack([np.bincount(origin, tint[:, k], minlength=n) for k in range(3)], 1) / np.maximum(count, 1)[:, None]
    )
    return Layer(mesh.vertices, origin[triangles], colour, gloss=0.25)


def eye_layers(head: Head) -> list[Layer]:
    """Both eyeballs without their corneas."""
    from ...sim.anatomy.head import MATERIALS

    return [part_layer(head.parts[f"eye_{s}"], MATERIALS[f"eye_{s}"]) for s in "lr"]


def mouth_layers(head: Head) -> list[Layer]:
    """Teeth, gums and tongue."""
    from ...sim.anatomy.head import MATERIALS

    return [part_layer(head.parts[n], MATERIALS[n]) for n in ("teeth_upper", "teeth_lower", "tongue")]


def bone_layers(head: Head) -> list[Layer]:
    """Skull and mandible."""
    return [
        part_layer(head.parts["skull"], ("bone",), BONE),
        part_layer(head.parts["mandible"], ("bone",), JAW),
    ]


def muscle_layers(head: Head) -> list[Layer]:
    """Every belly in a colour of its own, with its fibres as lines."""
    layers = []
    for m in head.muscles:
        base = m.name.removesuffix("_l").removesuffix("_r")
        hue = (sum(map(ord, base)) * 0.618) % 1
        colour = np.array(colorsys.hsv_to_rgb(hue, 0.55, 0.8)) * 0.6 + np.array([0.7, 0.25, 0.2]) * 0.4
        layers.append(Layer(m.shape.vertices, m.shape.triangles, colour))
    return layers


def sheet(layers, target, field, pixels=420, views=SIX) -> np.ndarray:
    """Six pictures of the same layers in two rows."""
    pictures = [draw(layers, camera(target, yaw, pitch, field, pixels)) for yaw, pitch in views]
    half = (len(pictures) + 1) // 2
    return montage([pictures[:half], pictures[half:]])


def sheets(head: Head, pixels: int = 420, beside: Mesh | None = None) -> dict:
    """Sheet name -> callable that draws it, (h, w, 3)."""
    skin, eyes, mouth = skin_layer(head.skin), eye_layers(head), mouth_layers(head)
    wire = skin_layer(head.skin, wire=True)
    marks = head.landmark_positions()
    lips, eye = (marks["ch_l"] + marks["ch_r"]) / 2, head.eyes[0].centre
    low = head.skin.vertices[:, 2].min()
    middle = np.array([0.0, -5.0, (low + marks["v"][2]) / 2])
    tall = marks["v"][2] - low + 40
    face = np.array([0.0, -40.0, -15.0])
    ear = (marks["t_l"] + marks["sa_l"]) / 2
    out = {
        "skin": lambda: sheet([skin, *eyes], middle, tall, pixels),
        "wire": lambda: sheet([wire, *eyes], middle, tall, int(1.4 * pixels)),
        "face": lambda: sheet([skin, *eyes, *mouth], face, 190, int(1.4 * pixels), SIX[:3] + SIX[4:5]),
        "facewire": lambda: sheet([wire, *eyes], face, 170, int(1.8 * pixels), SIX[:2]),
        "eye": lambda: montage(
            [
                [draw([s, *eyes], camera(eye, y, p, 50, pixels)) for y, p in ((0, 0), (45, 0), (-35, 5), (10, -35))]
                for s in (skin, wire)
            ]
        ),
        "ear": lambda: montage(
            [[draw([s], camera(ear, y, p, 85, pixels)) for y, p in ((90, 0), (50, 0), (140, 5), (100, 35))]
             for s in (skin, wire)]
        ),
        "lips": lambda: montage(
            [[draw([s, *mouth], camera(lips, y, p, 80, pixels)) for y, p in ((0, 0), (40, 0), (90, 0), (0, -40))]
             for s in (skin, wire)]
        ),
        "skull": lambda: sheet(bone_layers(head) + mouth, [0, -10, 5], 250, pixels),
        "muscles": lambda: sheet([*muscle_layers(head), *bone_layers(head), *eyes, *mouth], [0, -10, -10], 280, pixels),
        "teeth": lambda: sheet(mouth[:2], lips + [0, 25, 0], 90, pixels,
                               ((0, 0), (45, 0), (90, 0), (0, 50), (0, -50), (180, 10))),
        "tongue": lambda: sheet(mouth[1:], lips + [0, 25, -5], 100, pixels,
                                ((0, 30), (45, 30), (90, 0), (0, 80), (0, -50), (180, 30))),
        "eyes": lambda: montage([[draw(eyes, camera(eye, y, p, 40, pixels)) for y, p in ((0, 0), (45, 0), (90, 0))]]),
        "poses": lambda: poses(head, pixels),
    }  # fmt: skip
    if beside is not None:
        scan = Layer(beside.vertices, beside.triangles, SKIN if beside.colour is None else beside.colour)
        out["beside"] = lambda: montage(
            [
                [draw(layers, camera([0, -10, -20], y, p, 290, pixels)) for y, p in SIX]
                for layers in ([skin, *eyes], [scan])
            ]
        )
    return out


def poses(head: Head, pixels: int) -> np.ndarray:
    """Jaw and lids turned plainly, without simulation: shut, half shut, jaw half and wide open, from four sides."""
    marks = head.landmark_positions()
    face = np.array([0.0, -40.0, (marks["n"][2] + marks["gn"][2]) / 2 - 15])
    rows = []
    for pose in ({"blink": 1.0}, {"blink": 0.5, "jaw_open": 0.5}, {"jaw_open": 1.0}):
        posed = plainly_posed(head, **pose)
        layers = [skin_layer(posed.skin), *eye_layers(posed), *mouth_layers(posed)]
        rows.append([draw(layers, camera(face, y, p, 210, pixels)) for y, p in ((0, 0), (40, 5), (90, 0), (20, -30))])
    return montage(rows)


def main(argv: list[str]) -> int:
    """Draw the sheets into a folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--head", type=Path, help="another head file than the shipped one")
    parser.add_argument("--only", default="", help="sheet names, separated by commas")
    parser.add_argument("--beside", type=Path, help="a scan (PLY, mm, in the head's own place) to put beside the skin")
    parser.add_argument("--pixels", type=int, default=420)
    chosen = parser.parse_args(argv)
    beside = None
    if chosen.beside:
        from ...sim.scan.ply import read_ply

        beside = read_ply(chosen.beside)
    chosen.folder.mkdir(parents=True, exist_ok=True)
    drawn = sheets(load_head(chosen.head) if chosen.head else load_head(), chosen.pixels, beside)
    for name in chosen.only.split(",") if chosen.only else drawn:
        if name not in drawn:
            print(f"There is no sheet {name!r}: choose from {', '.join(drawn)}.", file=sys.stderr)
            return 2
        write_png(chosen.folder / f"{name}.png", drawn[name]())
        print(chosen.folder / f"{name}.png")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
