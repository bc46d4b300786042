# SPDX-License-Identifier: GPL-3.0-or-later
"""What the creases along the eyes tell: lids that meet have one, the margins of open ones two."""

import numpy as np

from ..adapt.closest import Surface
from ..adapt.eye_frame import eye_frame
from ..adapt.lid_line import PLAIN, SECOND, LidLine, lid_line
from .shape_fit import ShapeFit, Told
from .shape_space import ShapeSpace


def lid_lines(space: ShapeSpace, fit: ShapeFit, target: Surface, sides: str = "lr") -> dict[str, LidLine]:
    """Side -> the `LidLine` of the eyes on these ``sides`` of the scan on which the head ``fit`` is laid."""
    marks = space.landmarks(fit.points)
    return {side: lid_line(marks, side, target, fit.matrix) for side in sides}


def shut_by_creases(lines: dict[str, LidLine]) -> bool | None:
    """Whether the creases of eyes, side -> `LidLine`, show them shut; None: they do not tell."""
    if min(line.depth for line in lines.values()) < PLAIN:
        return None
    return float(np.mean([line.second / line.depth for line in lines.values()])) < SECOND


def told_of_lids(space: ShapeSpace, fit: ShapeFit, lines: dict[str, LidLine]) -> Told | None:
    """How high the ``lines`` on which shut lids meet, side -> `LidLine`, tell corners and margins of ``fit`` to lie; None: they
    are not seen plainly."""
    marks = space.landmarks(fit.points)
    up = fit.matrix[:, 2] / np.linalg.norm(fit.matrix[:, 2])
    told = {}
    for side, line in lines.items():
        if line.depth < PLAIN:
            continue
        eye = eye_frame(marks, side, fit.matrix)
        for name in (f"{base}_{side}" for base in ("en", "ps", "pi", "ex")):
            told[name] = marks[name] + (line.at(eye.share(marks[name])) - marks[name]) @ up * up
    return Told.of(space, told) if told else None
