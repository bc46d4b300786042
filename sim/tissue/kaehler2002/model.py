# SPDX-License-Identifier: GPL-3.0-or-later
"""`build_model`: the structure of Kähler et al. 2002, section 3, set up on a head."""

import numpy as np

from ...anatomy.head import JAW_PARTS, Head
from ...mesh import vertex_normals
from ..contact import build_surfaces
from ..geometry import short_diagonals
from ..layers import build_layers, sheet_ties
from ..lids import build_lids
from ..model import strengths
from ..parameters import DEFAULT as LAYERS
from ..pressure import build_pressure
from ..seal import build_seal
from .attachments import build_attachments
from .muscle_arrays import build_muscles
from .parameters import DEFAULT, Parameters
from .skin_mesh import about_nodes, build_skin_mesh, mirrored
from .skull import build_skull
from .structures import Model
from .volume import build_prisms

_RIGID = (*JAW_PARTS, "eye_l", "eye_r", "skull", "teeth_upper")


def build_model(head: Head, parameters: Parameters = DEFAULT, table: dict | None = None) -> Model:
    """Skin, muscles, attachments and constraints of ``head``. ``table``: as `tissue.model.strengths`, the shipped one."""
    table = strengths() if table is None else table
    layers = build_layers(head, LAYERS)
    n = len(layers.area)
    skin = head.skin.vertices
    triangles = short_diagonals(skin, head.skin.faces)
    free = layers.free[:n]
    fibres, axes = build_muscles(head, parameters, table)
    attachments = build_attachments(head, layers, fibres, parameters)
    ties = sheet_ties(head, layers)
    rest = np.concatenate([skin, attachments.foot, mirrored(skin, attachments.foot)])
    prisms, volume = build_prisms(rest, triangles, free)
    springs = build_skin_mesh(head.skin.faces, skin, attachments, layers, ties, parameters)
    skull = build_skull(layers, vertex_normals(skin, triangles), parameters.skull_margin, parameters.skull_area)
    lids = tuple(x for x in (build_lids(head, layers, side) for side in "lr") if x is not None)
    about = about_nodes(springs, n)
    about[skull.node] += 2 * skull.stiffness
    for each in lids:
        about[each.column] += parameters.lid * each.hold
    return Model(
        parameters=parameters,
        muscle_names=tuple(m.name for m in head.muscles),
        layers=layers,
        springs=springs,
        prisms=prisms,
        prism_volume=volume,
        skull=skull,
        attachments=attachments,
        fibres=fibres,
        axes=axes,
        lids=lids,
        contacts=build_surfaces(head, layers, ties),
        seal=build_seal(head, layers),
        pressure=build_pressure(head, layers, parameters),
        jaw=head.jaw,
        eyes=head.eyes,
        rest=rest,
        free=free,
        stiffness=about,
        mass=np.maximum(layers.area * parameters.mass_area, parameters.mass_least),
        rigid={p: head.parts[p].vertices for p in _RIGID if p in head.parts},
    )
