# SPDX-License-Identifier: GPL-3.0-or-later
"""The colour of irises, where a scan shows them."""

import numpy as np

from ..mesh import Mesh
from .colour_space import LUMINANCE, to_linear


def iris_colour(scan: Mesh, eyes) -> np.ndarray | None:
    """(3,) linear colour of the irises as the scan saw them, or None where it cannot be told.

    Closed lids and a scanner's guesses show skin there: only what is cooler or much darker than skin is believed.
    """
    colour = to_linear(np.asarray(scan.colour, dtype=float))
    ring, around = [], []
    for eye in eyes:
        gaze = eye.gaze / np.linalg.norm(eye.gaze)
        offset = scan.vertices - eye.centre
        depth = offset @ gaze
        radius = np.linalg.norm(offset - depth[:, None] * gaze, axis=1) / eye.radius
        near = (depth > 0.6 * eye.radius) & (depth < 1.5 * eye.radius)
        ring.append(colour[near & (radius > 0.24) & (radius < 0.42)])
        around.append(colour[(depth > 0) & (radius > 2.0) & (radius < 3.0)])
    ring, around = np.concatenate(ring), np.concatenate(around)
    if len(ring) < 20 or len(around) < 20:
        return None
    found, skin = np.median(ring, axis=0), np.median(around, axis=0)
    cooler = found[2] / max(found[0], 1e-4) > 1.5 * skin[2] / max(skin[0], 1e-4)
    if not cooler and found @ LUMINANCE > 0.3 * (skin @ LUMINANCE):
        return None
    # a colour, not the light it was seen in; the lightest irises return about a sixth of the light
    return found * np.clip(found @ LUMINANCE, 0.03, 0.16) / max(found @ LUMINANCE, 1e-4)
