# SPDX-License-Identifier: GPL-3.0-or-later
"""Muscle strength from the motion people show: at activation 1 the skin's peak moves by the table's millimetres.

A head's own compliance is measured at build, by one linear solve per muscle with the solver's matrix. That matrix is
stiffer than the tissue (it resists springs sideways, too), by a ratio that belongs to the muscle's place in the face
and hardly to the head: the table's ``gain``, measured once on the reference head with full solves (`measured_gains`).
"""

from dataclasses import replace

import numpy as np

from .muscle_field import base_name
from .solver import factorised
from .structures import Control, Model


def calibrated(model: Model, table: dict) -> Model:
    """``model`` with `MuscleField.strength` set, after ``table`` (`model.strengths`); none where no skin is touched."""
    m = model.muscles
    n = model.count
    active = np.unique(m.owner)
    strength = np.zeros(len(m.names))
    if not len(active):
        return replace(model, muscles=replace(m, strength=strength))
    free = model.cache["matrix"]["free"]
    place = np.full(2 * n, -1)
    place[free] = np.arange(len(free))
    force = np.zeros((len(free), 3 * len(active)))
    for column, k in enumerate(active):
        rows = m.owner == k
        at = place[m.column[rows] + n]
        force[at, 3 * column : 3 * column + 3] = m.weight[rows, None] * m.direction[rows]
    moved = factorised(model).solve(force)[free < n].astype(float).reshape(-1, len(active), 3)
    peak = np.sqrt((moved**2).sum(axis=2)).max(axis=0)
    gain = np.array([float(table.get(base_name(m.names[k]), {}).get("gain", 1.5)) for k in active])
    goal, reach = m.excursion[active], m.reach[active]
    share = np.clip(1 - goal / reach, 0.1, 1)  # what is left of the force when the goal is reached
    strength[active] = np.where(peak > 1e-9, goal / np.maximum(peak * gain * share, 1e-12), 0.0)
    return replace(model, muscles=replace(m, strength=strength))


def measured_gains(model: Model, table: dict, rounds: int = 3) -> dict[str, float]:
    """Base name -> gain with which full activation moves the skin's peak by the table's millimetres on ``model``."""
    from .solver import solve

    m = model.muscles
    gains = {}
    for k in np.unique(m.owner):
        base = base_name(m.names[k])
        if m.names[k].endswith("_r") or m.excursion[k] <= 0:
            continue
        gain = float(table.get(base, {}).get("gain", 1.5))
        strength = m.strength.copy()
        activation = np.zeros(len(m.names))
        activation[k] = 1.0
        control = Control(activation, np.zeros(3), np.zeros((2, 2)), np.zeros(2))
        state = None
        share = np.clip(1 - m.excursion[k] / m.reach[k], 0.1, 1)
        for _ in range(rounds):
            trial = replace(model, muscles=replace(m, strength=strength))
            # wholly at rest: short of it rounding decides by how much, and gains would differ from one processor to the next
            solution = solve(trial, control, state, max_iterations=300, tolerance=1e-3)
            state = solution.state
            peak = max(solution.diagnostics["peak_mm"], 0.05)
            # force needed at the goal, to first order in what is missing (a spent muscle pulls less)
            left = np.clip(1 - peak / m.reach[k], 0.05, 1)
            factor = np.clip(m.excursion[k] / peak * left / share, 0.4, 2.5)
            strength[k] *= factor
            gain /= factor
        gains[base] = round(gain, 3)
    return gains
