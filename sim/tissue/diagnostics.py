# SPDX-License-Identifier: GPL-3.0-or-later
"""What a solve says about itself, as plain numbers for the report."""

import numpy as np

from . import contact
from .lids import depth_in_eyeballs
from .planes import depths
from .structures import Model
from .volume import prism_volumes


def diagnose(model: Model, pose, positions, planes, energy, residual) -> dict:
    """residual mm, energy, volume_drift (share of the prisms' volume), penetration_mm (deepest, skin with eyeball,
    teeth and lips), bone_penetration_mm (fascia with bone), inverted_prisms, peak_mm (largest skin motion)."""
    n = model.count
    volume = prism_volumes(positions, model.prisms) if len(model.prisms) else np.ones(1)
    rest = model.prism_volume if len(model.prisms) else np.ones(1)
    fascia = positions[n : 2 * n]
    bone = contact.bone_planes(model.contacts.bones, model.layers, fascia, pose.rotation, pose.translation)
    moved = np.linalg.norm(positions[:n] - model.layers.nodes[:n], axis=1)
    eye = depth_in_eyeballs(model.lids, positions, pose.gaze_of)
    return {
        "residual": float(residual),
        "energy": float(energy),
        "volume_drift": float(volume.sum() / rest.sum() - 1),
        "penetration_mm": float(max(depths(planes, positions).max(initial=0.0), eye)),
        "bone_penetration_mm": float(depths(bone, positions).max(initial=0.0)),
        "inverted_prisms": int((volume <= 0).sum()),
        "peak_mm": float(moved.max(initial=0.0)),
    }
