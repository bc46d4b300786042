# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyes that a scan shows shut, where the landmarks given say nothing of their lids."""

import numpy as np

from ..adapt.closest import Surface
from ..adapt.thin_plate_spline import similarity
from ..anatomy.head import Head
from ..progress import Work
from .expression import fit_expression, meeting_lids
from .placed_face import run
from .pose_search import Pose
from .shape_fit import NoFaceError, fit_shape
from .shape_space import shape_space

LOOKING = "Looking at the lids"


def with_shut_lids(reference: Head, target: Surface, given: dict[str, np.ndarray]) -> Work:
    """Work returning the landmarks ``given`` (name -> (3,) mm) and, of eyes that are shut and whose lids are not among them,
    ``ps`` and ``pi`` where the lids meet.

    A plausible head laid on the scan, as where landmarks are found, tells whether they do.
    """
    asked = [side for side in "lr" if f"ps_{side}" not in given and f"pi_{side}" not in given]
    rest = reference.landmark_positions()
    names = [name for name in given if name in rest]
    if not asked or len(names) < 4:
        return given
    space, target = shape_space(reference), target.coarser()
    matrix, shift = similarity([rest[name] for name in names], [given[name] for name in names])
    scale = np.cbrt(np.linalg.det(matrix))
    try:
        fit = yield from run(fit_shape(space, target, Pose(scale, matrix / scale, shift, 0.0)), 0.0, 0.6, LOOKING)
        fit, shown = yield from run(fit_expression(space, target, fit), 0.6, 1.0, LOOKING)
    except NoFaceError:
        return given
    met = meeting_lids(space, fit, target, [side for side in shown.shut if side in asked])
    laid = space.landmarks(fit.points)
    for name in met:
        # The corners of an eye, where they are given, tell how far the head laid on the scan is off there.
        corners = [corner for corner in (f"en_{name[-1]}", f"ex_{name[-1]}") if corner in given]
        met[name] = met[name] + np.mean([given[c] - laid[c] for c in corners] or np.zeros((1, 3)), axis=0)
    return given | met
