# SPDX-License-Identifier: GPL-3.0-or-later
"""How much more than its skin a muscle must shorten: full contraction moves the skin's peak by the table's millimetres.

The skin a muscle drags holds it back, and so do the muscles merged with it. By how much belongs to the muscle's place in
the face and hardly to the head, so it is measured once, on the reference head (`measured_gains`), and kept here. Where
anatomy bounds it (`MOST`) the skin moves less than the table asks.
"""

from dataclasses import replace

import numpy as np

from ..muscle_field import base_name
from ..structures import Control

#: Base name -> gain, from `measured_gains` on the reference head; the lips' by eye; what is not named has `USUAL`.
GAINS: dict[str, float] = {
    "frontalis_inner": 2.0,
    "frontalis_major": 1.89,
    "frontalis_outer": 2.03,
    "corrugator": 1.17,
    "lateral_corrugator": 2.62,
    "depressor_supercilii": 1.55,
    "procerus": 2.71,
    "orbicularis_oculi_orbital": 1.05,
    "levator_labii_alaeque_nasi": 2.56,
    "levator_labii_superioris": 1.37,
    "zygomaticus_minor": 2.23,
    "zygomaticus_major": 1.95,
    "levator_anguli_oris": 2.27,
    "buccinator": 1.17,
    "risorius": 2.09,
    "depressor_anguli_oris": 1.59,
    "depressor_labii_inferioris": 1.34,
    "mentalis": 1.13,
    "incisivus_labii_superioris": 3.48,
    "incisivus_labii_inferioris": 2.57,
    "nasalis_transverse": 3.79,
    "nasalis_alar": 1.47,
    "depressor_septi": 2.91,
    "platysma": 1.53,
    "auricularis": 2.01,
    "occipitalis": 3.21,
    "orbicularis_oris_upper": 1.8,
    "orbicularis_oris_lower": 1.8,
}
USUAL = 1.3
#: What `Muscle.max_shortening` may be exceeded by: that is an estimate for the belly as a whole, and with this at most half
#: of the length is lost, which is what striated muscle can do (sarcomeres work from 3.6 to 1.3 micrometres, with their best
#: length between: Gordon, Huxley and Julian 1966, recalled).
MOST = 1.5


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
        most = MOST * muscles[k].max_shortening / usual
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
