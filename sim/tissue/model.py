# SPDX-License-Identifier: GPL-3.0-or-later
"""`build_model`: from a head to a model that acts."""

from pathlib import Path

import numpy as np

from ..anatomy.head import JAW_PARTS, Head
from ..json_keys import read_table
from . import calibration
from .contact import build_surfaces
from .drawn_contact import build_drawn
from .energy import system_matrix
from .geometry import cotangent_stiffness, short_diagonals
from .layers import build_layers, sheet_ties
from .lids import build_lids
from .muscle_field import build_muscle_field
from .parameters import DEFAULT, Parameters
from .pressure import build_pressure
from .regions import region_of
from .seal import build_seal
from .springs import build_springs
from .structures import Control, Layers, Model, MuscleField, Solution, Springs, State
from .volume import prism_volumes

__all__ = ["Control", "Layers", "Model", "MuscleField", "Solution", "Springs", "State", "build_model", "strengths"]

STRENGTHS = Path(__file__).resolve().parents[2] / "assets" / "tables" / "strengths.json"


def strengths(path=STRENGTHS) -> dict:
    """Muscle base name -> {"excursion_mm", …}: what the skin is seen to move at full contraction.

    Raises
    ------
    InputError : ``path`` cannot be read, or is no such table.
    """
    return read_table(path, "muscles")["muscles"]


def build_model(head: Head, parameters: Parameters = DEFAULT, table: dict | None = None) -> Model:
    """Tissue, muscles, jaw and lids of ``head`` (Lee, Terzopoulos and Waters 1995, section 3), muscles calibrated.

    table : as `strengths`; the shipped one by default.
    """
    table = strengths() if table is None else table
    layers = build_layers(head, parameters)
    n = len(layers.area)
    ties = sheet_ties(head, layers)
    triangles = short_diagonals(head.skin.vertices, head.skin.faces)
    prisms = np.concatenate([triangles, triangles + n], axis=1)
    # a prism pressed flat by a sharp fold of the skin has no volume to keep
    volume = prism_volumes(layers.nodes, prisms)
    moving = layers.free[:n][triangles].any(axis=1)
    corner = layers.nodes[triangles]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1) / 2
    kept = moving & (volume > 0.4 * area)  # a mean height of 0.4 mm
    laplacian = cotangent_stiffness(layers.nodes[:n], triangles)
    lids = tuple(x for x in (build_lids(head, layers, side) for side in "lr") if x is not None)
    contacts = build_surfaces(head, layers, ties)
    model = Model(
        parameters=parameters,
        layers=layers,
        springs=build_springs(head.skin.faces, layers, parameters, ties),
        prisms=prisms[kept],
        prism_volume=volume[kept],
        region=region_of(head, triangles[kept]),
        bending=laplacian,
        muscles=build_muscle_field(head, layers, table),
        seal=build_seal(head, layers),
        pressure=build_pressure(head, layers, parameters),
        lids=lids,
        contacts=contacts,
        drawn=build_drawn(head, layers, contacts.arches, lids),
        jaw=head.jaw,
        eyes=head.eyes,
        faces=head.skin.faces,
        triangles=triangles,
        mass=np.tile(layers.area * parameters.mass_area / 2, 2),
        exposed=np.asarray(head.groups.get("inner", np.zeros(n)), float) < 0.5,
        rigid={
            p: head.parts[p].vertices for p in (*JAW_PARTS, "eye_l", "eye_r", "skull", "teeth_upper") if p in head.parts
        },
    )
    model.cache["matrix"] = system_matrix(model)
    return calibration.calibrated(model, table)
