# SPDX-License-Identifier: GPL-3.0-or-later
"""A model whose forces are reckoned in single precision: near enough for a frame that plays, and with half to carry."""

from dataclasses import replace

import numpy as np

from .structures import Model
from .volume import prism_volumes


def single(model: Model) -> Model:
    """``model`` for a `forces.Landscape` in single precision. Lengths and volumes at rest are measured as those of a pose
    are, so that the rest stays at rest."""
    if "single" not in model.cache:
        nodes = model.layers.nodes.astype(np.float32)
        d = (nodes[model.springs.second] - nodes[model.springs.first]).T
        parts = {name: getattr(model.springs, name).astype(np.float32) for name in ("stiffness", "stiff", "limit")}
        springs = replace(model.springs, rest=np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), **parts)
        matrix = model.cache["matrix"]
        matrix = matrix | {name: matrix[name].astype(np.float32) for name in ("gather", "quadratic")}
        volume = prism_volumes(nodes, model.prisms)
        model.cache["single"] = replace(model, springs=springs, prism_volume=volume, cache={"matrix": matrix})
    return model.cache["single"]
