# SPDX-License-Identifier: GPL-3.0-or-later
"""What a solve says about itself, as plain numbers for the report."""

import numpy as np

from .clearing import surfaces_of
from .planes import depths, row_depths
from .regions import REGIONS
from .structures import Model
from .volume import prism_volumes


def diagnose(model: Model, pose, positions, energy, residual) -> dict:
    """What `solve` reports:

    residual : mm, the largest quasi-Newton step that is left
    energy : in the units of the stiffness times mm²
    volume_drift, volume_drift_of : share of the prisms' volume gained or lost, of all and region -> of each region
    penetration_mm, penetration_of : the deepest, mm, of all pairs of surfaces and pair -> of each (`clearing.PAIRS`),
        beyond what there is at rest
    bone_penetration_mm : that of fascia and bone
    inverted_prisms : how many are inside out
    peak_mm : the largest motion of a vertex of the skin
    """
    n = model.count
    moved = np.linalg.norm(positions[:n] - model.layers.nodes[:n], axis=1)
    volume, rest = prism_volumes(positions, model.prisms), model.prism_volume
    now, before = (np.bincount(model.region, v, minlength=len(REGIONS)) for v in (volume, rest))
    pairs = {
        name: float(max(depths(planes, positions).max(initial=0.0), row_depths(planes, positions).max(initial=0.0)))
        for name, planes in surfaces_of(model, pose, positions).items()
    }
    return {
        "residual": float(residual),
        "energy": float(energy),
        "volume_drift": float(now.sum() / before.sum() - 1) if before.sum() > 0 else 0.0,
        "volume_drift_of": {name: float(now[k] / before[k] - 1) for k, name in enumerate(REGIONS) if before[k] > 0},
        "penetration_mm": max(pairs.values()),
        "penetration_of": pairs,
        "bone_penetration_mm": pairs["fascia_skull"],
        "inverted_prisms": int((volume <= 0).sum()),
        "peak_mm": float(moved.max(initial=0.0)),
    }
