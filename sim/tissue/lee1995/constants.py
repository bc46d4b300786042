# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of Lee, Terzopoulos and Waters 1995, 3.10, and the few that the paper leaves open.

Units. The paper names none. Its springs are linear in length, so lengths in millimetres change nothing; its time step of
0.01 is read as seconds and its mass of 0.5 as grams, so a stiffness is in g/s² and damping in g/s: no number of 3.10 had
to be converted. A force comes out in g mm/s² (µN). Only k1 multiplies a volume and carries a length: it is in g/s²/mm².

What these numbers mean: a node's velocity dies at damping / mass = 60 per second, but a face follows its muscles at
stiffness / damping, where the muscle layer holds it with 10: three seconds. The skin of 1995 lags, by its own parameters.
"""

import math
from dataclasses import dataclass

from ...finite_numbers import require_from_zero


@dataclass(frozen=True)
class Constants:
    """Of every node or spring: g, s, g/s, g/s². The first block is 3.10's; the second is ours, the paper gives no values.

    volume : k1 of 3.6, g/s²/mm²; shape : k2 of 3.6
    restoration : the nodal restoration force of 3.8 over bone under 8 mm of tissue, less where it is thicker or soft
    biphasic_strain : strain at which a dermal-fatty spring goes over to its second phase
    time_step : s, or less where that is not stable; infinite: the longest that is

    Raises
    ------
    InputError : one is not a finite number from 0 up, but for an infinite time step.
    """

    mass: float = 0.5
    time_step: float = 0.01
    damping: float = 30.0
    epidermis: float = 60.0
    dermal_fatty: float = 30.0
    dermal_fatty_stiff: float = 70.0
    fascia: float = 80.0
    muscle_layer: float = 10.0

    volume: float = 1.0
    shape: float = 20.0
    restoration: float = 5.0
    biphasic_strain: float = 0.3

    def __post_init__(self):
        longest = {"time_step"} if self.time_step == math.inf else set()
        require_from_zero("The tissue", {n: v for n, v in vars(self).items() if n not in longest})


DEFAULT = Constants()
