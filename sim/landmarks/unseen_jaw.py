# SPDX-License-Identifier: GPL-3.0-or-later
"""A face of which the scan ends at the mouth: where its jaw is, nothing but its likeliest shape tells.

Closest points lay the lower lip on the upper one then, as that faces the same way and is the nearest that does, and a chin of
which the scan has nothing comes after.
"""

from dataclasses import replace

import numpy as np

from ..adapt.closest import Surface
from .confidence import in_mid_air
from .hidden_skin import SEEN
from .looking import SIZE
from .placed_face import begun_again
from .shape_fit import ShapeFit, pairs
from .shape_space import ShapeSpace

JAW, CHIN = ("li", "sl", "pg", "gn"), ("pg", "gn")
#: The way from ls to sl with lip and chin looked for, of what it is without, below which they are pulled up. Of ten heads, each
#: cut off from above the upper lip to under the lower one in five ways, it was .47 to .65 in seven scans with sl 7 to 20 mm
#: too high, .83 in one with 5, and .91 and more in the others.
PULLED_UP = 0.9
BELOW = 1.2  # times the way from sto to gn: so far from there lips and chin are not looked for
#: The same, of what is filled in, about as far as to pg. Filled in as a whole, the jaw came out .2 to .5 mm farther from the
#: true one in three of four scans; what is below follows well enough.
FILLED = 0.6


def with_unseen_jaw(space: ShapeSpace, target: Surface, fit: ShapeFit):
    """A generator: yields the fraction done, returns ``fit`` and ``space``, or, if the scan has no chin and that of ``fit`` is
    pulled up, a fit whose lower lip and chin are not looked for, and a space in which they no longer count."""
    if not lacks_chin(space, fit, target):
        return fit, space
    blind = replace(space, area=np.where(below_lips(space), 0.0, space.area))
    again = yield from begun_again(blind, target, fit, SIZE)
    if again is None or lip_to_chin(space, fit) > PULLED_UP * lip_to_chin(space, again):
        return fit, space
    return again, blind


def lacks_chin(space: ShapeSpace, fit: ShapeFit, target: Surface) -> bool:
    """Whether the scan has nothing where ``fit`` has the chin."""
    marks = space.landmarks(fit.points)
    return bool(in_mid_air(target, [marks[name] for name in CHIN]).all())


def unseen_jaw(space: ShapeSpace, fit: ShapeFit, target: Surface) -> np.ndarray:
    """(n,) bool: the points of the lower lip and the skin under it that a scan ``target`` without a chin does not show."""
    if not lacks_chin(space, fit, target):
        return np.zeros(len(fit.points), dtype=bool)
    _, trust, _ = pairs(space, fit.points, target, SEEN * fit.pose.scale)
    return below_lips(space, FILLED) & (trust == 0)


def below_lips(space: ShapeSpace, reach: float = BELOW) -> np.ndarray:
    """(n,) bool: the lower lip and what is below it, in and out, up to ``reach`` times the way from sto to gn."""
    marks = space.landmarks(space.points)
    far = np.linalg.norm(space.points - marks["sto"], axis=1) / np.linalg.norm(marks["gn"] - marks["sto"])
    return (space.points[:, 2] < marks["sto"][2]) & (far < reach)


def lip_to_chin(space: ShapeSpace, fit: ShapeFit) -> float:
    """mm upward from ``sl`` to ``ls`` of the skin that ``fit`` has laid on the scan, in the reference's size."""
    marks = space.landmarks(fit.points)
    return float((marks["ls"] - marks["sl"]) @ fit.pose.turn[:, 2] / fit.pose.scale)
