# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure the mean head: ``python -m headshop.assets.generators.skin_average HEADS_FOLDER``.

The folder holds ``ict/neutral.ply`` and ``neutral.landmarks.json`` (ICT-FaceKit, MIT), ``makehuman/mh_heads.npz``
(MakeHuman, CC0) and ``scans/lps_infinite.ply`` with landmarks (Lee Perry-Smith, CC-BY). Our own layout is brought onto
each head; the average after generalised Procrustes (Gower 1975), made symmetric and brought toward adult norms,
is written to ``assets/tables/mean_head.npz``. Only this step needs the heads.
"""

import json
import sys
from pathlib import Path

import numpy as np

from ...sim.adapt.thin_plate_spline import similarity
from ...sim.anatomy.head import SurfacePoints
from ...sim.mesh import Mesh
from ...sim.scan.ply import read_ply
from .skin import make_skin
from .skin_fit import fit_skin, outer_skin
from .skin_groups import skin_groups
from .skin_landmarks import skin_landmarks
from .skin_layout import skin_layout
from .skin_norms import norms, toward_norms
from .skin_place import place_grid
from .skin_rays import MeasuredHead
from .skin_rings import place_rings
from .skin_shape import MEAN_HEAD

#: Share of each head in the mean.
SHARES = {
    "ict_neutral": 0.40,
    "lps_infinite": 0.21,
    "caucasian_male_young": 0.10,
    "caucasian_female_young": 0.11,
    "african_male_young": 0.09,
    "asian_female_young": 0.09,
}

#: Landmarks decided by touch or measurement: taken from the first head's landmark file and carried along.
TOUCHED = ("ft", "zy", "go", "t", "or", "os", "sci", "al", "ac", "cph", "obs", "obi")

#: Landmarks read off the MakeHuman base head by eye, as rays (see `skin_controls`), mm in its own frame.
_MAKEHUMAN = {
    **{"en": ("F", 17, 18.5), "ex": ("F", 44.5, 18.5), "ps": ("F", 31, 24.8), "pi": ("F", 31, 14.6)},
    **{"sn": ("F", 0, -28.5), "ls": ("F", 0, -40), "cph": ("F", 6.5, -38.7), "li": ("F", 0, -59.5)},
    **{"ch": ("F", 25.8, -48), "al": ("F", 17, -16), "g": ("F", 0, 32), "n": ("F", 0, 22), "pg": ("F", 0, -80)},
    **{"t": ("S", 17.5, 2), "sa": ("S", 26, 24.5), "sba": ("S", 20, -25.5), "pa": ("S", 42, 6), "gn": ("D", 0, -56)},
    "prn": ("F", 0, -15),
}


def _landmarks(path: Path) -> dict[str, np.ndarray]:
    return {k: np.array(v, float) for k, v in json.loads(path.read_text())["landmarks"].items()}


def _first_head(folder: Path):
    """Vertices, triangles and landmarks of the ICT mean head, origin midway between the tragia."""
    mesh = read_ply(folder / "ict" / "neutral.ply")
    found = _landmarks(folder / "ict" / "neutral.landmarks.json")
    origin = 0.5 * (found["t_l"] + found["t_r"])
    return mesh.vertices - origin, mesh.triangles, {k: p - origin for k, p in found.items()}


def _makehuman(folder: Path):
    """Name -> vertices, triangles, landmarks: the landmarks sit at the same places of the shared triangles."""
    with np.load(folder / "makehuman" / "mh_heads.npz") as file:
        triangles, base = file["F"], file["base"].astype(float)
        heads = {name: file[name].astype(float) for name in SHARES if name in file.files}
    measured = MeasuredHead(base, triangles)
    points = measured.controls(list(_MAKEHUMAN.values()))
    spots = {}
    for name, p in zip(_MAKEHUMAN, points, strict=True):
        both = {name: p * [0, 1, 1]} if abs(p[0]) < 1 else {name + "_l": p, name + "_r": p * [-1, 1, 1]}
        for key, at in both.items():
            near = measured.surface.closest(at[None])
            corners = measured.surface.vertices[measured.surface.triangles[near.triangle[0]]]
            index = [int(np.argmin(((base - c) ** 2).sum(axis=1))) for c in corners]
            spots[key] = (index, near.weights[0])
    for name, vertices in heads.items():
        yield name, vertices, triangles, {k: w @ vertices[i] for k, (i, w) in spots.items()}


def _frankfurt(vertices: np.ndarray, points: SurfacePoints) -> np.ndarray:
    """Tragia on the x axis, orbitale level with them."""
    at = points.on({"skin": vertices})
    vertices = vertices - [0, at["t_l"][1], at["t_l"][2]]
    gap = at["or_l"] - at["t_l"]
    turn = -np.arctan2(gap[2], -gap[1])
    c, s = np.cos(turn), np.sin(turn)
    return vertices @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def _lower_vault(vertices: np.ndarray, floor: float, share: float = 0.92) -> np.ndarray:
    """The heads measured have high skulls: the part above the brow keeps ``share`` of its height."""
    over = vertices[:, 2] - floor
    t = np.clip(over / 60, 0, 1)
    out = vertices.copy()
    out[:, 2] = np.where(over > 0, floor + over * (1 - (1 - share) * t * t * (3 - 2 * t)), vertices[:, 2])
    return out


def mean_head(folder: Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Vertices (n, 3) mm of the mean head and its `TOUCHED` landmarks (left side, mm)."""
    layout = skin_layout()
    vertices, triangles, found = _first_head(folder)
    head = MeasuredHead(vertices, triangles)
    start = place_rings(layout, place_grid(layout, head), head)
    inner = skin_groups(layout, start)["inner"]
    seeds = {name: found[name + "_l"] for name in TOUCHED}
    points = skin_landmarks(layout, start, Mesh(start, layout.faces).triangles, inner, seeds)
    own = points.on({"skin": start})
    fits = {"ict_neutral": start}
    scan = read_ply(folder / "scans" / "lps_infinite.ply")
    marks = _landmarks(folder / "scans" / "lps_infinite.landmarks.json")
    shut = {k: p for k, p in marks.items() if not k.startswith(("ps", "pi"))}  # this head was scanned with closed eyes
    fits["lps_infinite"] = fit_skin(layout, start, own, scan.vertices, scan.triangles, shut, eyes_open=False)
    for name, other, faces, marks in _makehuman(folder):
        fits[name] = fit_skin(layout, start, own, other, faces, marks)
    outer = outer_skin(layout)
    mean = start
    for _ in range(3):
        total = np.zeros_like(mean)
        for name, share in SHARES.items():
            turn, shift = similarity(fits[name][outer], mean[outer])
            total += share * (fits[name] @ turn.T + shift)
        total /= sum(SHARES.values())
        mean = 0.5 * (total + total[layout.mirror] * [-1, 1, 1])
    mean = _frankfurt(mean, points)
    mean = _lower_vault(mean, points.on({"skin": mean})["n"][2] - 5)
    mean = toward_norms(mean, points)
    mean = _frankfurt(0.5 * (mean + mean[layout.mirror] * [-1, 1, 1]), points)
    at = points.on({"skin": mean})
    seeds = {name: at[name + "_l"] for name in TOUCHED}
    seeds["ft"] = seeds["ft"] + [3, 0, 0]
    return mean, seeds


def main(argv: list[str]) -> int:
    """Write the table and print how the head stands beside the norms."""
    if len(argv) != 1:
        print(__doc__, file=sys.stderr)
        return 2
    vertices, seeds = mean_head(Path(argv[0]))
    layout = skin_layout()
    np.savez_compressed(
        MEAN_HEAD,
        left=vertices[layout.left].astype(np.float32),
        seed_names=np.array(list(seeds)),
        seeds=np.array(list(seeds.values()), dtype=np.float32),
        sources=np.array([f"{name}: {share}" for name, share in SHARES.items()]),
    )
    at = make_skin().landmarks.on({"skin": make_skin().mesh.vertices})
    for norm in norms():
        print(f"{norm.name:28s}{norm.measure(at):8.1f}{norm.mean:8.1f} +- {norm.sd:4.1f}{norm.score(at):7.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
