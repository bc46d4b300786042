# SPDX-License-Identifier: GPL-3.0-or-later
"""The constants of the model of Kähler et al. 2002, which prints none: ratios from Lee et al. 1995, 3.10, or our own."""

from dataclasses import dataclass

from ...finite_numbers import require_from_zero


@dataclass(frozen=True)
class Parameters:
    """Lengths mm, masses g, times s; stiffness in the units of Lee et al. 1995, 3.10, ``_area`` per mm² of skin."""

    #: springs along the edges of the skin; biphasic: the second number beyond ``strain`` (3.3 and 3.10 of Lee et al.).
    skin: float = 60.0
    skin_stiff: float = 120.0
    strain: float = 0.3
    #: springs from a vertex to its place on muscle or bone, the mirrored ones, and the struts to the places beside it.
    attachment_area: float = 8.0
    strut_area: float = 4.0
    #: pressure per relative change of volume, and the stiffness that keeps skin off bone.
    volume: float = 30.0
    skull_area: float = 12.0
    #: mm under which the skin feels the bone, at most half of what lies between at rest.
    skull_margin: float = 1.5
    #: muscles: tension per mm² of cross-section and strain; bed per mm² of muscle; what contraction multiplies both by.
    fibre: float = 250.0
    bed: float = 0.75
    active: float = 20.0
    #: mm within which the ends of axes that share a fibre's end merge into one node; farther ones are tied by a spring.
    merge: float = 7.0
    #: mm within which a muscle's end and a sphincter's axis merge.
    interlace: float = 8.0
    #: share of a vertex that its topmost muscle takes; the rest is for those under it, then for bone.
    opacity: float = 0.9
    #: mm along its line by which the centre of either half of the orbicularis oris goes forward at full contraction.
    protrusion: float = 8.0
    #: contact of lips, lids and teeth, which the paper leaves out, in multiples of ``skin``; lids held to their turn.
    contact: float = 6.0
    lid: float = 1500.0
    #: air in the mouth, force per mm² of cheek; lips held together, per mm². Both are our own, as in the other solver.
    puff: float = 12.0
    puff_reach: float = 30.0
    seal: float = 90.0
    #: grams per mm² of skin (5 mm of tissue at 1 g/cm³), the least mass of a vertex, damping per second, stiffness unit
    #: in g/s²: as in our own solver, so that both settle in a few frames.
    mass_area: float = 0.005
    mass_least: float = 0.02
    damping_rate: float = 30.0
    dynamic_scale: float = 60.0

    def __post_init__(self):
        require_from_zero("The tissue", vars(self))


DEFAULT = Parameters()
