# SPDX-License-Identifier: GPL-3.0-or-later
"""What a solve says about itself, as plain numbers for the report."""

import numpy as np

from .clearing import surfaces_of
from .planes import depths, row_depths
from .structures import Model
from .volume import prism_volumes


def diagnose(model: Model, pose, positions, energy, residual) -> dict:
    """residual mm, energy, volume_drift (share of the prisms' volume) and the same of each region, penetration_mm (the
    deepest of all pairs of surfaces), penetration of each pair (`clearing.PAIRS`), inverted_prisms, peak_mm (largest
    skin motion)."""
    n = model.count
    volume = prism_volumes(positions, model.prisms) if len(model.prisms) else np.ones(1)
    rest = model.prism_volume if len(model.prisms) else np.ones(1)
    moved = np.linalg.norm(positions[:n] - model.layers.nodes[:n], axis=1)
    pairs = {
        name: float(max(depths(planes, positions).max(initial=0.0), row_depths(planes, positions).max(initial=0.0)))
        for name, planes in surfaces_of(model, pose, positions).items()
    }
    return {
        "residual": float(residual),
        "energy": float(energy),
        "volume_drift": float(volume.sum() / rest.sum() - 1),
        "penetration_mm": max(pairs.values()),
        "bone_penetration_mm": pairs["fascia_skull"],
        "penetration_of": pairs,
        "inverted_prisms": int((volume <= 0).sum()),
        "peak_mm": float(moved.max(initial=0.0)),
    }
