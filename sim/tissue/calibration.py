# SPDX-License-Identifier: GPL-3.0-or-later
"""Muscle strength from the motion people show: at activation 1 the skin's peak moves by the table's millimetres.

The head's own compliance is measured at build: one linear solve per muscle gives the motion of a unit force; the
strength follows, with the loss of force on the way (`energy`: a muscle is spent at its reach).
"""

from dataclasses import replace

import numpy as np

from .structures import Model


def calibrated(model: Model) -> Model:
    """``model`` with `MuscleField.strength` set; muscles that touch no skin get none."""
    from .solver import _factor

    m = model.muscles
    n = model.count
    free = model.cache["matrix"]["free"]
    place = np.full(2 * n, -1)
    place[free] = np.arange(len(free))
    factor = _factor(model)
    strength = np.zeros(len(m.names))
    active = [k for k in np.unique(m.owner)] if len(m.owner) else []
    if not active:
        return model
    force = np.zeros((len(free), 3 * len(active)))
    for column, k in enumerate(active):
        rows = m.owner == k
        at = place[m.column[rows] + n]
        force[at, 3 * column : 3 * column + 3] = m.weight[rows, None] * m.direction[rows]
    moved = factor.solve(force)
    skin = free < n
    for column, k in enumerate(active):
        peak = float(np.linalg.norm(moved[skin, 3 * column : 3 * column + 3], axis=1).max())
        goal, reach = m.excursion[k], m.reach[k]
        if peak > 0 and goal > 0:
            strength[k] = goal / peak / max(1 - goal / reach, 0.1)
    return replace(model, muscles=replace(m, strength=strength))
