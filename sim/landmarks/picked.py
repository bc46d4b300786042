# SPDX-License-Identifier: GPL-3.0-or-later
"""Where somebody would pick the landmarks, seen from where the skin laid on the scan has them.

The reference's own landmarks are vertices of its layout, chosen for the build; people who pick landmarks on scans go by
what they see (Farkas 1994). Where the two differ, the place is moved along the surface. How far is a rounded mean over
landmarks picked on public heads: ICT-FaceKit (Li et al. 2020) and four scans, see the README's sources.
"""

import numpy as np

from ..adapt.closest import Surface
from .shape_fit import ShapeFit
from .shape_space import ShapeSpace

NEAR = 3.0  # mm on a head of the reference's size: the scan nearer than that has the landmark on it

#: Left side or midline: mm toward the subject's left, the back, up, from the reference's landmark.
MOVED = {
    "se": (0.0, 1.5, 3.0),  # deepest seen in profile, at the height of the upper lids' edges
    "prn": (0.0, 0.5, -1.5),  # foremost with the head in the Frankfurt horizontal, below the tip's middle
    "sbal": (3.0, 3.5, 0.0),  # in the crease, under the wing and not under the nostril's sill
    "ps": (2.5, 1.0, 0.0),  # above the middle of the pupil, not of the layout's lid
    "pi": (1.5, 0.5, 1.5),
    "or": (-1.0, 1.0, 2.5),  # felt just above the crease of the lower lid
    "ch": (1.0, 1.5, 0.3),  # in the corner, not on the red before it
    "en": (1.0, 0.5, 1.0),
    "go": (1.0, -5.0, 2.0),  # picked on the visible jaw line, before the ear lobe
    "sa": (4.5, 0.5, 1.5),  # on the free margin of the helix
    "sba": (3.5, 2.0, 0.5),
    "pa": (-0.5, -3.0, 3.5),
    "eu": (0.0, 2.0, -11.0),
    "op": (0.0, 0.0, 10.0),
}


def moved(name: str) -> np.ndarray:
    """(3,) mm on a head of the reference's size from its landmark ``name`` to where people pick it."""
    base, _, side = name.partition("_")
    x, y, z = MOVED.get(base, (0.0, 0.0, 0.0))
    return np.array([-x if side == "r" else x, y, z])


def picked(space: ShapeSpace, fit: ShapeFit, target: Surface) -> dict[str, np.ndarray]:
    """Name -> (3,) mm, where somebody would pick each landmark: on the scan, where it is near."""
    out = {}
    for name, place in space.landmarks(fit.points).items():
        out[name] = place + fit.matrix @ moved(name)
    names = list(out)
    found = target.closest(np.array([out[n] for n in names]), NEAR * fit.pose.scale)
    return {n: found.points[k] if found.found[k] else out[n] for k, n in enumerate(names)}
