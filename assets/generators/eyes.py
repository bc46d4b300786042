# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference eyes: the eye part of `sim.anatomy.eyeball` behind the lid margins, left and right."""

import numpy as np

from ...sim.adapt.flesh import cleared
from ...sim.anatomy.eyeball import BALL, eye_mesh
from ...sim.anatomy.head import MATERIALS, Eye
from ...sim.mesh import Mesh
from .eye_frame import MARGIN, eye_frames
from .skin_layout import skin_layout

#: Columns of the rings around the eye from the inner corner outward, of either lid, beside the caruncle.
LOWER, UPPER = (2, 3, 4), (2, 1, 0)

#: How far behind the edges of the lids the rim of the caruncle is tucked in, as a share of the way to the fornix.
TUCKED = (0.42, 0.5, 0.4)


def make_eyes(
    skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray]
) -> tuple[tuple[Mesh, Mesh], tuple[Eye, Eye]]:
    """((left, right) eye parts in mm, (left, right) `Eye`) behind the lid margins of the reference skin."""
    frames = eye_frames(skin.vertices)
    meshes = []
    for eye, side in zip(frames, "lr", strict=True):
        ring = skin_layout().rings[f"eye_{side}"]
        edge, fornix = skin.vertices[ring[MARGIN]], skin.vertices[ring[MARGIN + 1]]
        share = np.array(TUCKED)[:, None]
        backs = [edge[list(lid)] + share * (fornix - edge)[list(lid)] for lid in (LOWER, UPPER)]
        mesh = eye_mesh(eye, *backs)
        flesh = mesh.faces[mesh.material == MATERIALS["eye_l"].index("caruncle")] - BALL
        room = cleared(Mesh(mesh.vertices[BALL:], flesh), skin, eye)
        meshes.append(mesh.moved(np.concatenate([mesh.vertices[:BALL], room])))
    return (meshes[0], meshes[1]), frames
