# SPDX-License-Identifier: GPL-3.0-or-later
"""What a solve says about itself, as plain numbers for the report."""

import numpy as np

from ..eye_surface import depth_in_eyeballs
from ..planes import depths
from ..volume import prism_volumes
from .motion import barriers
from .posing import Pose
from .structures import LeeModel, LeeState


def diagnose(model: LeeModel, pose: Pose, state: LeeState, residual: float) -> dict:
    """Plain numbers: residual mm, speed mm/s, volume_drift (share of the prisms' volume), bone_penetration_mm (deepest,
    fascia with bone, 3.7), penetration_mm (skin with eyeball, teeth, lips and the lining of the mouth, of which the paper
    knows nothing), inverted_prisms, peak_mm (largest skin motion)."""
    n = model.count
    x = state.positions
    skin, rest = x[:n], model.layers.nodes[:n]
    volume = prism_volumes(x, model.elements.prisms) if len(model.elements.prisms) else np.ones(1)
    before = model.elements.volume if len(model.elements.prisms) else np.ones(1)
    bone, others = barriers(model, pose, x)
    eye = depth_in_eyeballs(model.lids, skin, lambda side: pose.gaze["lr".index(side)])
    return {
        "residual": float(residual),
        "speed": float(np.sqrt((state.velocities**2).sum(axis=1).max(initial=0.0))),
        "volume_drift": float(volume.sum() / before.sum() - 1),
        "penetration_mm": float(max(eye, depths(others, x).max(initial=0.0))),
        "bone_penetration_mm": float(depths(bone, x).max(initial=0.0)),
        "inverted_prisms": int((volume <= 0).sum()),
        "peak_mm": float(np.linalg.norm(skin - rest, axis=1).max(initial=0.0)),
    }
