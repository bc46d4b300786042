# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how skin moves: ``python -m headshop.assets.generators.skin_movement HEADS_FOLDER``.

The folder holds ``ict/facs_fields_skin.npz`` and ``ict/facs_map.json``: how the skin of ICT-FaceKit's mean head moves when an
action unit acts alone (Li et al. 2020, Learning formation of physically-based face
attributes, CVPR). Our own layout is brought onto that head, and the way of some of its points, about `GAP` mm apart, is read
off, both sides' mean; it goes to ``assets/tables/skin_movement.csv``. Only this step needs the head.
"""

import json
import sys
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from ...sim.adapt.closest import Surface
from ...sim.adapt.refine import scattered
from ...sim.adapt.thin_plate_spline import similarity
from ...sim.anatomy.storage import write_atomically
from ...sim.mesh_subdivision import drawn
from ...sim.relax.movement import TABLE, UNITS
from .skin import make_skin
from .skin_fit import fit_skin, outer_skin
from .skin_groups import skin_groups
from .skin_heads import first_head
from .skin_layout import skin_layout

#: mm between the points: where skin moves, around the mouth, and where it stays.
GAP, LIP_GAP, FAR_GAP = 15.0, 6.0, 40.0
MOVES = 0.3  # mm
MOUTH = 14.0  # mm around the lips' edges
SOURCE = (
    "ICT-FaceKit (MIT; Li et al. 2020, CVPR): its mean head, action units alone at full, read off at points of our skin"
)


def movement(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Points (k, 3) mm on the left half of the mean head's skin, and how each of `UNITS` moves them (k, units, 3) mm."""
    layout, skin = skin_layout(), make_skin()
    start = skin.mesh.vertices
    on = drawn(skin.mesh.faces, start)
    first = first_head(folder)
    laid, _ = fit_skin(layout, start, skin.landmarks.on({"skin": on}), first)
    there = drawn(skin.mesh.faces, laid)
    surface = Surface(first.vertices, first.triangles)
    near = surface.closest(there)
    corners = cKDTree(first.vertices).query(surface.vertices)[1][surface.triangles[near.triangle]]
    fields = np.array([np.einsum("kc,kcj->kj", near.weights, field[corners]) for field in _fields(folder)])
    outer = outer_skin(layout)
    turn, _ = similarity(there[outer], start[outer])
    fields = fields @ turn.T
    fields = 0.5 * (fields + fields[:, layout.mirror] * [-1, 1, 1])
    seen = near.found & (skin_groups(layout, start)["inner"] < 0.5) & (on[:, 0] > -1e-6)
    moves = np.linalg.norm(fields, axis=2).max(axis=0) > MOVES
    mouth = cKDTree(on[layout.rings["mouth"][5]]).query(on)[0] < MOUTH
    rows = []
    for some, gap in ((moves & ~mouth, GAP), (mouth, LIP_GAP), (~moves & ~mouth, FAR_GAP)):
        left = np.flatnonzero(seen & some)
        rows.append(left[scattered(on[left], gap)])
    pick = np.sort(np.concatenate(rows))
    return on[pick], fields[:, pick].transpose(1, 0, 2)


def _fields(folder: Path):
    """(n, 3) mm that each of `UNITS` moves the vertices of the first head."""
    names = json.loads((folder / "ict" / "facs_map.json").read_text(encoding="utf-8"))
    with np.load(folder / "ict" / "facs_fields_skin.npz") as file:
        every, scale, order = file["D"], float(file["D_scale"]), list(file["names"])
    for unit in UNITS:
        yield scale * sum(every[order.index(name)].astype(float) for name in names[unit])


def main(argv: list[str]) -> int:
    """Write the table."""
    if len(argv) != 1:
        print(__doc__, file=sys.stderr)
        return 2
    points, moves = movement(Path(argv[0]))
    head = ["x_mm", "y_mm", "z_mm", *(f"{unit}_{axis}_mm" for unit in UNITS for axis in "xyz")]
    lines = [f"# {SOURCE}", ",".join(head)]
    for place, way in zip(points.round(1) + 0.0, moves.reshape(len(points), -1).round(2) + 0.0, strict=True):
        lines.append(",".join([*(f"{x:.1f}" for x in place), *(f"{x:.2f}" for x in way)]))
    write_atomically(TABLE, ("\n".join(lines) + "\n").encode())
    print(f"{len(points)} points")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
