# SPDX-License-Identifier: GPL-3.0-or-later
"""Every part of a head in a pose."""

import numpy as np

from ..anatomy.eyeball import turned_eye
from ..anatomy.head import JAW_PARTS
from .eye_surface import gaze_rotation
from .jaw import jaw_transform
from .structures import Control, Model, State
from .tongue import tongue_out


def posed_parts(model: Model, state: State, control: Control) -> dict[str, np.ndarray]:
    """Part -> (n, 3) mm: the skin as solved, mandible, lower teeth and tongue with the jaw, the eyes with the gaze."""
    rotation, translation = jaw_transform(model.jaw, *control.jaw)
    out = {"skin": state.skin.copy()}
    for part, vertices in model.rigid.items():
        if part == "tongue":
            vertices = tongue_out(vertices, model.rigid.get("teeth_lower", vertices[:0]), control.tongue)
        if part in JAW_PARTS:
            out[part] = vertices @ rotation.T + translation
        elif part.startswith("eye_"):
            side = part[-1]
            centre = model.eyes["lr".index(side)].centre
            out[part] = turned_eye(vertices, centre, gaze_rotation(control.gaze_of(side)))
        else:
            out[part] = vertices.copy()
    return out
