# SPDX-License-Identifier: GPL-3.0-or-later
"""Sizes of the 32 permanent teeth after Wheeler's tables (Nelson and Ash, Dental Anatomy), and how each leans."""

from typing import NamedTuple


class Tooth(NamedTuple):
    """A permanent tooth: ``form`` (which master), lengths of crown and root, mesiodistal and labiolingual width of
    crown and neck, mm; ``torque`` and ``tip``, the lean of the crown toward the lips and toward the midline, degrees."""

    form: str
    crown: float
    root: float
    md: float
    md_neck: float
    ll: float
    ll_neck: float
    torque: float
    tip: float


UPPER = (
    Tooth("incisor", 10.5, 13.0, 8.5, 7.0, 7.0, 6.0, 22, 5),
    Tooth("incisor", 9.0, 13.0, 6.5, 5.0, 6.0, 5.0, 20, 8),
    Tooth("canine", 10.0, 17.0, 7.5, 5.5, 8.0, 7.0, 12, 8),
    Tooth("premolar", 8.5, 14.0, 7.0, 5.0, 9.0, 8.0, 3, 3),
    Tooth("premolar", 8.5, 14.0, 7.0, 5.0, 9.0, 8.0, 3, 2),
    Tooth("molar", 7.5, 12.5, 10.0, 8.0, 11.0, 10.0, 5, 1),
    Tooth("molar", 7.0, 11.5, 9.0, 7.0, 11.0, 10.0, 7, -3),
    Tooth("molar", 6.5, 11.0, 8.5, 6.5, 10.0, 9.5, 9, -8),
)
LOWER = (
    Tooth("incisor", 9.0, 12.5, 5.0, 3.5, 6.0, 5.3, 15, 1),
    Tooth("incisor", 9.5, 14.0, 5.5, 4.0, 6.5, 5.8, 14, 1),
    Tooth("canine", 11.0, 16.0, 7.0, 5.5, 7.5, 7.0, 6, 4),
    Tooth("premolar", 8.5, 14.0, 7.0, 5.0, 7.5, 6.5, -3, 4),
    Tooth("premolar", 8.0, 14.5, 7.0, 5.0, 8.0, 7.0, -6, 4),
    Tooth("molar", 7.5, 14.0, 11.0, 9.0, 10.5, 9.0, -9, 5),
    Tooth("molar", 7.0, 13.0, 10.5, 8.0, 10.0, 9.0, -11, 8),
    Tooth("molar", 7.0, 11.0, 10.0, 7.5, 9.5, 9.0, -13, 12),
)
