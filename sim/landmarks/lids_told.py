# SPDX-License-Identifier: GPL-3.0-or-later
"""The lids of eyes of which the landmarks given say nothing, where a scan shows them, shut or open."""

import numpy as np

from ..adapt.closest import Surface
from .expression import Expression, meeting_lids
from .open_lids import of_both_eyes
from .shape_fit import ShapeFit
from .shape_space import ShapeSpace


def lids_told(space: ShapeSpace, fit: ShapeFit, shown: Expression, target: Surface, given) -> dict[str, np.ndarray]:
    """Name -> (3,) mm: ``ps`` and ``pi`` of eyes whose lids are not among the landmarks ``given`` (name -> mm): where the lids
    meet of eyes that are ``shown`` shut, and the margins of those that are seen open; an eye that is not seen is as the other.

    fit : a plausible head laid on the scan ``target``
    """
    silent = [side for side in "lr" if f"ps_{side}" not in given and f"pi_{side}" not in given]
    met = meeting_lids(space, fit, target, [side for side in shown.shut if side in silent])
    laid = space.landmarks(fit.points)
    for name in met:
        # The corners of an eye, where they are given, tell how far the head laid on the scan is off there.
        corners = [corner for corner in (f"en_{name[-1]}", f"ex_{name[-1]}") if corner in given]
        met[name] = met[name] + np.mean([given[c] - laid[c] for c in corners] or np.zeros((1, 3)), axis=0)
    lids = shown.lids if shown.shut else of_both_eyes(shown.lids, laid)
    return met | {name: place for name, place in lids.items() if name[-1] in silent and name not in given}
