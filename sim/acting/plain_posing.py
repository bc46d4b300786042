# SPDX-License-Identifier: GPL-3.0-or-later
"""A head posed by jaw hinge, lids and gaze alone, without tissue: what riggers call the plain rig.

It shows whether weights, lips and lids are fit to move before any simulation is asked to help.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from ..anatomy.eyeball import turned_eye
from ..anatomy.head import JAW_PARTS, Head
from ..tissue.jaw import jaw_transform
from ..tissue.layers import build_layers
from ..tissue.lids import build_lids, gaze_rotation, lid_targets
from ..tissue.parameters import DEFAULT


def plainly_posed(
    head: Head, jaw_open=0.0, jaw_forward=0.0, jaw_side=0.0, blink: float | tuple[float, float] = 0.0, gaze=(0.0, 0.0)
) -> Head:
    """``head`` with the mandible at its place, skin following by the group ``jaw``, lids turned shut, eyes turned.

    Parameters
    ----------
    jaw_open : 0..1; jaw_forward, jaw_side : -1..1, shares of the jaw's limits
    blink : 0 open, 1 shut, one value or (left, right)
    gaze : (left, up) rad

    Every skin vertex turns about the hinge by its own share of the angle, so that nothing shrinks toward the axis as in
    linear blending.
    """
    vertices = {name: mesh.vertices for name, mesh in head.parts.items()}
    rotation, translation = jaw_transform(head.jaw, jaw_open, jaw_forward, jaw_side)
    for part in JAW_PARTS:
        vertices[part] = vertices[part] @ rotation.T + translation
    pivot = (head.jaw.condyle_l + head.jaw.condyle_r) / 2
    share = np.asarray(head.groups["jaw"], float)[:, None]
    turn = Rotation.from_rotvec(share * Rotation.from_matrix(rotation).as_rotvec())
    skin = turn.apply(head.skin.vertices - pivot) + pivot + share * (translation + rotation @ pivot - pivot)
    shut = np.broadcast_to(np.asarray(blink, float), (2,))
    gaze = np.asarray(gaze, float)
    if shut.any() or gaze.any():
        layers = build_layers(head, DEFAULT)
        for side, amount in zip("lr", shut, strict=True):
            lids = build_lids(head, layers, side)
            if lids is not None:
                skin[lids.column] = lid_targets(lids, amount, amount, gaze)
    around = gaze_rotation(gaze)
    for eye, side in zip(head.eyes, "lr", strict=True):
        part = f"eye_{side}"
        vertices[part] = turned_eye(vertices[part], eye.centre, around)
    return head.with_vertices({**vertices, "skin": skin})
