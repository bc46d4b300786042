# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyes that a scan shows shut, where the landmarks given say nothing of their lids."""

import numpy as np

from ..adapt.closest import Surface
from .expression import Expression, meeting_lids
from .shape_fit import ShapeFit
from .shape_space import ShapeSpace


def shut_lids(space: ShapeSpace, fit: ShapeFit, shown: Expression, target: Surface, given) -> dict[str, np.ndarray]:
    """Name -> (3,) mm: of eyes that are ``shown`` shut, and whose lids are not among the landmarks ``given`` (name -> mm),
    ``ps`` and ``pi`` where the lids meet.

    fit : a plausible head laid on the scan ``target``
    """
    asked = [side for side in shown.shut if f"ps_{side}" not in given and f"pi_{side}" not in given]
    met = meeting_lids(space, fit, target, asked)
    laid = space.landmarks(fit.points)
    for name in met:
        # The corners of an eye, where they are given, tell how far the head laid on the scan is off there.
        corners = [corner for corner in (f"en_{name[-1]}", f"ex_{name[-1]}") if corner in given]
        met[name] = met[name] + np.mean([given[c] - laid[c] for c in corners] or np.zeros((1, 3)), axis=0)
    return met
