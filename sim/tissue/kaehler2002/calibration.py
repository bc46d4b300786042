# SPDX-License-Identifier: GPL-3.0-or-later
"""How much more than its skin a muscle must shorten: full contraction moves the skin's peak by the table's millimetres.

The skin a muscle drags holds it back, and so do the muscles merged with it. By how much belongs to the muscle's place in
the face and hardly to the head, so it is measured once, on the reference head (`measured_gains`), and kept here. Where
`Muscle.max_shortening` bounds it the skin moves less than the table asks.
"""

from dataclasses import replace

import numpy as np

from ..muscle_field import base_name
from ..structures import Control

#: Base name -> gain, from `measured_gains` on the reference head; the lips' by eye; what is not named has `USUAL`.
GAINS: dict[str, float] = {
    "frontalis_inner": 1.64,
    "frontalis_major": 1.55,
    "frontalis_outer": 1.35,
    "corrugator": 0.78,
    "lateral_corrugator": 1.74,
    "depressor_supercilii": 1.03,
    "procerus": 1.81,
    "orbicularis_oculi_orbital": 0.88,
    "levator_labii_alaeque_nasi": 1.67,
    "levator_labii_superioris": 1.16,
    "zygomaticus_minor": 1.64,
    "zygomaticus_major": 1.45,
    "levator_anguli_oris": 1.94,
    "buccinator": 0.78,
    "risorius": 1.82,
    "depressor_anguli_oris": 1.06,
    "depressor_labii_inferioris": 1.2,
    "mentalis": 0.75,
    "incisivus_labii_superioris": 2.52,
    "incisivus_labii_inferioris": 1.72,
    "nasalis_transverse": 1.88,
    "nasalis_alar": 0.98,
    "depressor_septi": 1.94,
    "platysma": 1.28,
    "auricularis": 1.6,
    "occipitalis": 1.88,
    "orbicularis_oris_upper": 1.8,
    "orbicularis_oris_lower": 1.8,
}
USUAL = 1.3


def measured_gains(model, muscles, table: dict, rounds: int = 3) -> dict[str, float]:
    """Base name -> gain with which full activation moves the skin's peak by the table's millimetres on ``model``.

    muscles : those of the head, in the order of ``model.muscle_names``
    """
    from .solver import solve

    axes, found = model.axes, {}
    for row, k in enumerate(axes.muscles):
        name = model.muscle_names[k]
        if (
            name.endswith("_r") or axes.slide[row] > 0
        ):  # lips that protrude move more by their centre than by drawing in
            continue
        goal = float(table.get(base_name(name), {}).get("excursion_mm", 4.0))
        usual, gain = axes.shortening[row], 1.0
        most = muscles[k].max_shortening / usual
        activation = np.zeros(len(model.muscle_names))
        activation[k] = 1.0
        control = Control(activation, np.zeros(3), np.zeros((2, 2)), np.zeros(2))
        shortening = axes.shortening.copy()
        for _ in range(rounds):
            shortening[row] = usual * gain
            solution = solve(replace(model, axes=replace(axes, shortening=shortening)), control, tolerance=0.05)
            peak = solution.diagnostics["peak_mm"]
            gain = min(gain * float(np.clip(goal / max(peak, 0.05), 0.5, 2.0)), most)
        found[base_name(name)] = round(gain * GAINS.get(base_name(name), USUAL), 2)
    return found
