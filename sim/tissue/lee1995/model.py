# SPDX-License-Identifier: GPL-3.0-or-later
"""`build_model`: from a head to the face of 1995."""

from dataclasses import replace

import numpy as np

from ...anatomy.head import JAW_PARTS, Head
from ...mesh import vertex_normals
from .. import contact
from ..geometry import short_diagonals
from ..layers import sheet_ties
from ..lid_targets import lid_targets
from ..lids import build_lids
from ..model import strengths as shipped_table
from ..parameters import DEFAULT as SHARED
from .attachment import build_attachments
from .calibration import strengths, tangent_stiffness
from .constants import DEFAULT, Constants
from .depth import layered
from .elements import build_elements, build_springs
from .lining import kept_inside
from .posing import HELD
from .puff import puff_forces
from .stability import stable_step, stiffest
from .structures import LeeModel

#: mm of flesh through which skin and the lining behind it are tied to each other.
FLESH = 14.0
#: mm that cheeks go out when fully blown up.
PUFF_MM = 14.0


def build_model(head: Head, constants: Constants = DEFAULT, table: dict | None = None) -> LeeModel:
    """Prisms, muscles, skull and lids of ``head``. table : as `tissue.model.strengths`, the shipped one by default."""
    table = shipped_table() if table is None else table
    layers = layered(head)
    n = len(layers.area)
    ties = sheet_ties(head, layers, FLESH)
    contacts = kept_inside(head, layers, contact.build_surfaces(head, layers, ties))
    lids = tuple(x for x in (build_lids(head, layers, side) for side in "lr") if x is not None)
    free = layers.free.copy()
    for each in lids:
        held = each.hold > HELD
        free[each.column[held]] = False
        free[each.column[held & each.upper] + n] = False  # under the lower lid fascia gives way to a raised cheek
    layers = replace(layers, free=free)
    triangles = short_diagonals(head.skin.vertices, head.skin.faces)
    moving = np.concatenate([free, np.zeros(n, bool)])
    # what holds soft flesh to its place is ours, not the paper's: by area, or the fine mesh of the lips would be held fast
    even = np.minimum(layers.area / SHARED.element_area, 1.0)
    factor = layers.restoration / (SHARED.restoration_area * layers.area) * even
    restoration = constants.restoration * np.concatenate([factor, factor, np.zeros(n)])
    soften = layers.soften * np.where(layers.bony, 1.0, even)
    springs = build_springs(triangles, layers.nodes, moving, constants, ties, soften, layers.sheet)
    elements = build_elements(triangles, layers.nodes, moving)
    muscles = build_attachments(head, layers, table)
    puff = puff_forces(head, layers)
    matrix = tangent_stiffness(springs, elements, restoration, layers.nodes, triangles, constants)
    strength, blown = strengths(muscles, layers, matrix, puff)
    corner = layers.nodes[elements.prisms[:, :3]]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1) / 2
    rigid = (*JAW_PARTS, "eye_l", "eye_r", "skull", "teeth_upper")
    return LeeModel(
        constants=constants,
        layers=layers,
        springs=springs,
        elements=elements,
        restoration=restoration,
        muscles=replace(muscles, strength=strength),
        lids=lids,
        lid_rest=tuple(lid_targets(x, 0.0, 0.0, np.zeros(2)) for x in lids),
        bones=contacts.bones,
        contacts=contacts,
        puff=puff * (PUFF_MM / blown if blown > 1e-9 else 0.0),
        time_step=stable_step(stiffest(springs, elements, area, restoration, constants), constants),
        jaw=head.jaw,
        eyes=head.eyes,
        faces=head.skin.faces,
        triangles=triangles,
        rest_normals=vertex_normals(head.skin.vertices, triangles),
        rigid={p: head.parts[p].vertices for p in rigid if p in head.parts},
    )
