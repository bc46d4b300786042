# SPDX-License-Identifier: GPL-3.0-or-later
"""A head posed by jaw hinge, lids and gaze alone, without tissue: what riggers call the plain rig.

It shows whether weights, lips and lids are fit to move before any simulation is asked to help.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from ..anatomy.eyeball import turned_eye
from ..anatomy.head import JAW_PARTS, Head
from ..tissue.eye_surface import gaze_rotation
from ..tissue.jaw import jaw_transform
from ..tissue.layers import build_layers
from ..tissue.lid_targets import lid_targets
from ..tissue.lids import build_lids
from ..tissue.parameters import DEFAULT

#: Share of the jaw's way aside that the lips go together: in the middle, and how much more at the corner the jaw goes
#: to, less at the other. The lining there is pushed along by the teeth, the more the less it belongs to either jaw.
_LIPS_ASIDE, _CORNER_ASIDE = 0.48, 0.3
_PUSHED, _PUSH = 0.9, 1.2
#: Opening the mouth lowers the hyoid, which takes the throat's skin along, and draws the corners of the mouth and the
#: cheeks in between the jaws: by how much at most, against the condyles' slide.
_THROAT_DOWN, _CHEEK_IN = 1.2, 0.3


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
    linear blending. Aside the lips slide along the teeth without parting.
    """
    vertices = {name: mesh.vertices for name, mesh in head.parts.items()}
    rotation, translation = jaw_transform(head.jaw, jaw_open, jaw_forward, jaw_side)
    for part in JAW_PARTS:
        vertices[part] = vertices[part] @ rotation.T + translation
    share = np.asarray(head.groups["jaw"], float)
    pivot = (head.jaw.condyle_l + head.jaw.condyle_r) / 2
    first = jaw_transform(head.jaw, jaw_open, jaw_forward)
    skin = _turned(head.skin.vertices, share, *first, pivot)
    skin += np.clip(jaw_open, 0, 1) ** 1.5 * head.jaw.slide_max * _given_way(head, share)
    if jaw_side:
        rest = rotation @ first[0].T  # from there to the whole
        pivot, rest_shift = first[0] @ pivot + first[1], translation - rest @ first[1]
        skin = _turned(skin, _aside(head, share, np.sign(jaw_side)), rest, rest_shift, pivot)
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


def _turned(points, share, rotation, translation, pivot):
    """Points (n, 3) mm moved by ``share`` (n,) of a rigid motion: of its angle about the axis through ``pivot``."""
    share = share[:, None]
    turn = Rotation.from_rotvec(share * Rotation.from_matrix(rotation).as_rotvec())
    return turn.apply(points - pivot) + pivot + share * (translation + rotation @ pivot - pivot)


def _given_way(head: Head, share: np.ndarray) -> np.ndarray:
    """(n, 3) how far the skin between the jaws gives way to the wide open mouth, against the condyles' slide."""
    between, neck = 4 * share * (1 - share), np.asarray(head.groups["neck"], float)
    out = np.zeros((len(share), 3))
    out[:, 2] = -_THROAT_DOWN * between * neck
    across = head.skin.vertices[:, 0]
    out[:, 0] = -_CHEEK_IN * between * (1 - neck) * (1 - head.groups["mouth_bag"]) * np.clip(across / 20, -1, 1)
    return out


def _aside(head: Head, share: np.ndarray, side: float) -> np.ndarray:
    """(n,) share of the jaw's motion to the ``side`` (1 left, -1 right): lips slide along the teeth without parting."""
    lips = np.minimum(head.groups["lip_upper"] + head.groups["lip_lower"], 1)
    across = side * head.skin.vertices[:, 0]
    corner = np.abs(across[lips > 0.9]).max()
    together = lips * (_LIPS_ASIDE + _CORNER_ASIDE * np.clip(across / corner, -1, 1) - share)
    lining = head.groups["mouth_bag"] * (1 - lips) * np.clip((across / corner + 0.4) / 0.8, 0, 1)
    pushed = lining * np.clip(6 * share * (1 - share), 0, 1) * np.clip(_PUSHED - share, 0, None)
    return share + together + _PUSH * pushed
