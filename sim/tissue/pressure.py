# SPDX-License-Identifier: GPL-3.0-or-later
"""Air in the mouth: cheeks puffed out or sucked in (Lee, Terzopoulos and Waters 1995, section 5).

"Cheek puffing was created by applying outwardly directed radial forces to inflate the deformable cheeks." Here the
force is a pressure: per mm² of the skin that the vestibule of the mouth lies behind, along its outward normal.
"""

import numpy as np

from ..anatomy.head import Head
from ..mesh import vertex_normals
from .geometry import short_diagonals
from .parameters import Parameters
from .structures import Layers, Pressure

#: Share of the pressure that each group of the skin feels; the lips are held by their own sphincter.
FELT = {"cheek": 1.0, "lip_upper": 0.5, "lip_lower": 0.5}


def build_pressure(head: Head, layers: Layers, parameters: Parameters) -> Pressure:
    """The `Pressure` of ``head``; without entries where the head has no cheeks."""
    n = len(layers.area)
    felt = np.zeros(n)
    for name, share in FELT.items():
        sides = [np.asarray(head.groups[k], float) for k in (name, f"{name}_l", f"{name}_r") if k in head.groups]
        felt = np.maximum(felt, share * np.max(sides, axis=0) if sides else 0.0)
    inner = np.asarray(head.groups.get("inner", np.zeros(n)), float) > 0.5
    column = np.flatnonzero((felt > 0.05) & layers.free[:n] & ~inner)
    normals = vertex_normals(head.skin.vertices, short_diagonals(head.skin.vertices, head.skin.faces))
    return Pressure(column, normals[column], felt[column] * layers.area[column], parameters.puff, parameters.puff_reach)
