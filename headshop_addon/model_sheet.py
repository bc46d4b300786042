# SPDX-License-Identifier: GPL-3.0-or-later
"""One expression by every model side by side: seen from the front and from the side, and how far the skin moves."""

import bpy
import numpy as np

from ..sim.acting.expressions import expressions, for_head
from ..sim.acting.models import MODELS
from ..sim.acting.pose import Pose, control
from ..sim.errors import InputError
from ..sim.mesh_subdivision import smoother
from ..sim.progress import Progress, Work
from ..sim.tissue.posing import posed_parts
from . import heads
from .contact_sheet import Tile, compose
from .heat_sheet import drawn_view
from .materials import head_axes
from .outputs import Outputs
from .pictures import render_picture, write_picture
from .shape_keys import ITERATIONS
from .stage import aim_camera
from .studio import Model, studio

WIDTH, HEIGHT = 420, 504  # pixels of one picture
VIEWS = (("From the front", 4.0), ("From the side", 40.0))  # degrees toward the subject's left
SHOWN = ("skin", "features")
NEARER = 1.25  # than a portrait: the face is what is compared
FAR = 12.0  # mm at the end of the colour scale
#: sRGB over the share of `FAR` that the skin moves.
SCALE = np.array([(0.42, 0.42, 0.43), (0.55, 0.50, 0.30), (0.92, 0.62, 0.16), (0.86, 0.22, 0.12), (0.45, 0.03, 0.20)])


def render_models(skin: bpy.types.Object, path, expression: str = "smile", samples: int = 8) -> Work:
    """Render the sheet into a PNG file; returns its path.

    expression : a name of the table of expressions

    Raises
    ------
    InputError : not a head, or no such expression.
    """
    table = expressions()
    if expression not in table:
        raise InputError(f"There is no expression {expression!r}: choose one of {', '.join(table)}.")
    head = heads.read_head(skin)
    pose = for_head(table[expression], {muscle.name for muscle in head.muscles})
    moved = {"": {part: np.zeros_like(mesh.vertices) for part, mesh in head.parts.items()}}
    for number, acting in enumerate(MODELS.values()):
        yield Progress(0.4 * number / len(MODELS), f"Acting by {acting.title}")
        moved[acting.title] = _acted(acting, head, pose)
    rows = []
    with Outputs() as outputs:
        target = outputs.file(path)
        with studio(skin, width=WIDTH, height=HEIGHT, samples=samples) as (scene, frame):
            model = Model(scene, skin, frame)
            model.show(*SHOWN)
            for number, (view, yaw) in enumerate(VIEWS):
                aim_camera(scene, frame, yaw, aspect=WIDTH / HEIGHT, close=True)
                scene.camera.data.lens *= NEARER
                tiles = []
                for place, (title, deltas) in enumerate(moved.items()):
                    done = (number + place / len(moved)) / len(VIEWS)
                    yield Progress(0.4 + 0.5 * done, f"Rendering {title or 'rest'}")
                    model.move(deltas)
                    tiles.append((Tile(title or "Rest", "", SHOWN), render_picture(scene)[..., :3]))
                rows.append((view, tiles))
        yield Progress(0.92, "Drawing how far the skin moves")
        rows.append((f"How far the skin moves: grey not at all, purple {FAR:.0f} mm or more", _maps(head, moved)))
        name = expression.replace("_", " ")
        page = compose(heads.head_name(skin), f"The same {name} by every model", rows, len(moved))
        write_picture(target, page)
    return path


def _acted(acting, head, pose) -> dict[str, np.ndarray]:
    """Part -> displacements (n, 3) mm."""
    model = acting.build(head)
    asked = control(model, pose)
    solution = acting.solve(model, asked, max_iterations=ITERATIONS)
    posed = posed_parts(model, solution.state, asked)
    rest = posed_parts(model, acting.rest_state(model), control(model, Pose()))
    return {part: vertices - rest[part] for part, vertices in posed.items()}


def _maps(head, moved) -> list:
    """Tiles of the surface drawn, coloured by how far it moves."""
    axes, cage = head_axes(head), head.skin
    operator, quads = smoother(cage.faces, len(cage.vertices))
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    at = head.landmark_positions()
    middle = axes @ (at["g"] + at["sn"] + at["gn"] + at["t_l"] + at["t_r"]) / 5
    tiles = []
    for title, deltas in moved.items():
        far = np.linalg.norm(operator @ deltas["skin"], axis=1)
        place = np.linspace(0, FAR, len(SCALE))
        colours = np.stack([np.interp(far, place, channel) for channel in SCALE.T], axis=1)
        drawn = operator @ ((cage.vertices + deltas["skin"]) @ axes.T)
        picture = drawn_view(drawn, triangles, colours, middle, 0.0, WIDTH, HEIGHT, 0.5 / NEARER)
        tiles.append((Tile(title or "Rest", f"up to {far.max():.1f} mm" if title else "", SHOWN), picture))
    return tiles
