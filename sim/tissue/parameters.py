# SPDX-License-Identifier: GPL-3.0-or-later
"""The constants of the tissue, with their sources.

Stiffness keeps the ratios of Lee, Terzopoulos and Waters 1995, 3.10 (epidermis 60, dermal-fatty 30 then 70, fascia 80,
muscle layer 10). The paper gives them per spring of one fixed mesh; here springs along a layer keep the number (a
mesh of equal springs has a stretching stiffness that does not depend on its fineness), and springs across layers
scale with the area each stands for, so the same face behaves alike on any mesh. The unit of force is arbitrary:
muscle strength is calibrated in millimetres of motion, only ratios matter at rest. ``mass`` and ``damping`` set the
time scale of `step`.
"""

from dataclasses import dataclass

from ..finite_numbers import require_from_zero


@dataclass(frozen=True)
class Parameters:
    """Tissue constants; lengths mm, stiffness in the units of 3.10, ``_area`` per mm² of skin.

    Raises
    ------
    InputError : one is not a finite number from 0 up.
    """

    epidermis: float = 60.0
    dermal_fatty: float = 30.0
    dermal_fatty_stiff: float = 70.0
    biphasic_strain: float = 0.3
    fascia: float = 80.0
    muscle_layer: float = 10.0
    #: mm² of skin that one through-spring of the paper stands for (684 elements on a face patch; about 8 mm edges).
    element_area: float = 28.0
    #: k1 of 3.6, per mm³ of relative change.
    volume: float = 30.0
    #: share of its volume under which a prism resists so many times more (own; keeps folds from turning inside out).
    crushed: float = 0.3
    hardening: float = 10.0
    #: nodal restoration h of 3.8, per mm² of skin, over bone under `restoration_thickness` mm of tissue.
    restoration_area: float = 0.55
    restoration_thickness: float = 8.0
    #: bending of the skin sheet, from the ratio of bending to stretching: the length (mm) under which it evens out.
    bending_length: float = 6.0
    #: contact penalties, in multiples of the epidermal stiffness.
    contact: float = 10.0
    lid: float = 1500.0
    #: lips held together, per mm² of lip.
    seal: float = 125.0
    #: force of full pressure in the mouth, per mm² of cheek, and the mm of motion at which it is spent.
    puff: float = 6.0
    puff_reach: float = 18.0
    #: grams per mm² of skin: 5 mm of tissue at about 1 g/cm³.
    mass_area: float = 0.005
    #: per second; about 0.3 of critical for the slowest modes, the cheeks'.
    damping_rate: float = 50.0
    #: converts the stiffness unit to g/s² where masses or outer forces act. The sheet of skin and fascia then has a modulus
    #: of 8.5 kPa over 5 mm; 31 to 42 kPa were measured on faces, locally, by aspiration (Luboz, Promayon and Payan 2014).
    dynamic_scale: float = 180.0

    def __post_init__(self):
        require_from_zero("The tissue", vars(self))


DEFAULT = Parameters()
