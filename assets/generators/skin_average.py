# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure the mean head: ``python -m headshop.assets.generators.skin_average HEADS_FOLDER``.

The folder holds the heads of `skin_heads`. Our own layout is placed on the first of them and brought from there onto
each; the average after generalised Procrustes (Gower 1975), made symmetric and smooth, is the start of the next round.
The last, brought toward adult norms, is written to ``assets/tables/mean_head.npz``. Only this step needs the heads.
"""

import sys
from pathlib import Path

import numpy as np

from ...sim.adapt.thin_plate_spline import similarity
from ...sim.anatomy.head import SurfacePoints
from ...sim.mesh import Mesh
from ...sim.mesh_subdivision import drawn
from .skin import make_skin
from .skin_bust import bust_between, bust_columns, place_bust
from .skin_fit import fit_skin, outer_skin
from .skin_groups import skin_groups
from .skin_heads import SHARES, first_head, heads
from .skin_landmarks import skin_landmarks
from .skin_layout import skin_layout
from .skin_norms import norms, toward_norms
from .skin_place import place_grid
from .skin_rays import MeasuredHead
from .skin_rings import place_rings
from .skin_shape import MEAN_HEAD

#: Rounds of bringing the last mean onto every head and averaging anew.
ROUNDS = 2

#: Landmarks decided by touch or measurement: taken from the first head's landmark file and carried along.
TOUCHED = ("ft", "zy", "go", "t", "or", "os", "sci", "al", "ac", "cph", "obs", "obi")


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


def _average(layout, fits, mean: np.ndarray) -> np.ndarray:
    """Mean (n, 3) of fits (subject, vertices, known), each laid on the last mean by its known part; symmetric."""
    outer = outer_skin(layout)
    bust = np.concatenate([bust_columns(layout)[:, 1:].ravel(), bust_between(layout)[0]])
    for last in (False, False, True):
        total, weight = np.zeros_like(mean), np.zeros((len(mean), 1))
        for subject, vertices, known in fits:
            sure = outer & (known > 0.6)
            turn, shift = similarity(vertices[sure], mean[sure])
            part = subject.share * np.where(outer, 0.02 + known, 0.5)[:, None]
            laid = vertices @ turn.T + shift
            if last:
                part[bust] = 0
            if last and subject.shoulders:
                head = MeasuredHead(subject.vertices @ turn.T + shift, subject.triangles)
                for way in (1, -1):
                    half = (laid if way > 0 else laid[layout.mirror]) * [way, 1, 1]
                    place_bust(layout, half, head if way > 0 else head.mirrored())
                    side = bust if way > 0 else layout.mirror[bust]
                    total[side] += subject.share * half[bust] * [way, 1, 1]
                    weight[side] += subject.share
            total += part * laid
            weight += part
        mean = total / weight
        mean = 0.5 * (mean + mean[layout.mirror] * [-1, 1, 1])
    return mean


def mean_head(folder: Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Vertices (n, 3) mm of the mean head and its `TOUCHED` landmarks (left side, mm)."""
    layout = skin_layout()
    first = first_head(folder)
    head = MeasuredHead(first.vertices, first.triangles)
    mean = place_rings(layout, place_grid(layout, head), head)
    inner = skin_groups(layout, mean)["inner"]
    seeds = {name: first.landmarks[name + "_l"] for name in TOUCHED}
    points = skin_landmarks(layout, mean, Mesh(mean, layout.faces).triangles, inner, seeds)
    for _ in range(ROUNDS):
        own = points.on({"skin": mean})
        fits = [(subject, *fit_skin(layout, mean, own, subject)) for subject in heads(folder)]
        mean = _frankfurt(_average(layout, fits, mean), points)
    mean = _lower_vault(mean, points.on({"skin": mean})["n"][2] - 5)
    mean = toward_norms(layout.faces, mean, points)
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
    skin = make_skin()
    at = skin.landmarks.on({"skin": drawn(skin.mesh.faces, skin.mesh.vertices)})
    for norm in norms():
        print(f"{norm.name:28s}{norm.measure(at):8.1f}{norm.mean:8.1f} +- {norm.sd:4.1f}{norm.score(at):7.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
