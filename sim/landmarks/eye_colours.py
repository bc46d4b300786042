# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether eyes are open, as a scan's colours tell: skin lies on shut ones, and white, an iris and a pupil in open ones.

Lids that a soft scan has lost, as phones fuse it in voxels of two millimetres, are seen in its colours still.
"""

import numpy as np

from ..adapt.eye_frame import eye_frame
from ..mesh import Mesh
from ..scan.colour_space import to_linear

#: Half of what is looked at of an eye, of the way between its corners and in mm, and mm that it lies above that; skin about it,
#: below: from so far, and to so far, from its middle; mm before and behind it.
INSIDE, ABOVE = (0.375, 4.5), 1.0
AROUND = (0.8, 18.0), (1.1, 26.0)
DEEP = 25.0
FEW = 12  # vertices
#: Of the skin's own: light that less than is no skin, and more than; and how much bluer that is than the skin.
DARK, BRIGHT, COOL = 0.45, 1.3, 1.25
RED = 1.15  # more red than blue: skin. Colours that show anything else, a map of distances for one, tell nothing.
#: Share of an eye that is no skin. Of 36 open eyes it is .59 and more, of the two shut ones of another scan .005 and less.
SOME, MOST = 0.25, 0.4


def open_by_colours(scan: Mesh | None, marks, matrix, sides: str = "lr") -> bool | None:
    """Whether the eyes on these ``sides`` are open, as the colours of the vertices of ``scan`` (mm) show; None: they do not.

    marks : name -> (3,) mm, about where ``en`` and ``ex`` lie; matrix (3, 3) turns and scales the reference into the scan
    """
    if scan is None or scan.colour is None:
        return None
    shares = [_no_skin(scan, eye_frame(marks, side, matrix)) for side in sides]
    if any(share is None for share in shares):
        return None
    share = float(np.mean(shares))
    return True if share > MOST else False if share < SOME else None


def _no_skin(scan, eye) -> float | None:
    """0..1, how much of an ``eye``, an `EyeFrame`, has not the colour of the skin below it; None: too little is seen."""
    half = np.linalg.norm(eye.way) / 2 / eye.scale
    near = np.flatnonzero(np.linalg.norm(scan.vertices - eye.middle, axis=1) < 3 * half * eye.scale)
    off = (scan.vertices[near] - eye.middle) / eye.scale
    x, y, z = off @ eye.along, off @ eye.forward, off @ eye.up
    x, before = x / (2 * half), np.abs(y) < DEEP
    inside = before & ((x / INSIDE[0]) ** 2 + ((z - ABOVE) / INSIDE[1]) ** 2 < 1)
    (a, b), (c, d) = AROUND
    below = before & (z < 0) & ((x / a) ** 2 + (z / b) ** 2 > 1) & ((x / c) ** 2 + (z / d) ** 2 < 1)
    if min(inside.sum(), below.sum()) < FEW:
        return None
    colour = to_linear(np.clip(np.asarray(scan.colour[near], dtype=float), 0, 1))
    light, blue = colour.mean(axis=1), colour[:, 2] / np.maximum(colour[:, 0], 1e-3)
    if np.median(blue[below]) > 1 / RED:
        return None
    light, blue = (values[inside] / max(np.median(values[below]), 1e-3) for values in (light, blue))
    return float(np.mean((light < DARK) | (light > BRIGHT) | (blue > COOL)))
