# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of the jaw's turn each vertex of the reference skin takes part in: made for plain rotation about the hinge.

Seen from the hinge the cheek is a fan: skin above the mouth stays, skin below goes with the mandible, and the ray
between them widens toward the cheek. Behind the ramus and below the jaw's border the share dies away into ear and neck.
The lips have shares of their own, so that they open to an oval.
"""

import numpy as np

from .skin_lips import lip_places
from .skin_shape import landmark_seeds

#: From the tragion to the hinge: mm back (y) and up (z).
_HINGE = (-11.5, -7.0)

#: The chin is found this far down from the lips, mm.
_CHIN = 60.0

#: The fan at |x| mm: degrees from its middle ray, which goes through the lips' corners, to where nothing or all moves.
_FAN = ([0, 16, 45], [8.0, 9.0, 21.0])

#: mm over which the share dies away below the line from chin to jaw angle: begins, ends at the throat and at the side.
_BELOW = (10.0, 57.0, 50.0)

#: The same behind the rear border of the ramus: ends at the height of the ear lobe and of the jaw angle; its length.
_BEHIND = (-5.0, 14.0, 36.0)

#: Opening of the lips by steps from the corner to the middle, 1 = all: an ellipse.
_OVAL = (0.0, 0.47, 0.66, 0.78, 0.87, 0.935, 0.975, 0.994, 1.0)

#: The same in the lining behind: by steps up the cheek to the roof and down to the floor.
_LINING = (0.0, 0.36, 0.70, 0.92, 1.0, 1.0, 1.0, 1.0, 1.0)

#: How far the rings round the mouth follow the lips (the rest follows the cheek), and those inside follow the lining.
_FOLLOW = {0: 0.12, 1: 0.45, 2: 0.8, 3: 1.0, 4: 1.0, 5: 1.0, 6: 1.0, 7: 1.0}
_INSIDE = {8: 0.5, 9: 1.0, 10: 1.0, 11: 1.0}


def _ease(t):
    """0 below 0, 1 above 1, and level at both ends."""
    t = np.clip(t, 0, 1)
    return t * t * t * (10 + t * (6 * t - 15))


def _cheek(layout, vertices: np.ndarray) -> np.ndarray:
    """(n,) share by place alone."""
    seeds = landmark_seeds()
    hinge, angle = seeds["t"][1:] + _HINGE, seeds["go"][1:]
    flat_corner = vertices[layout.rings["mouth"][3, 19]][1:]
    corner = flat_corner - hinge
    aside, flat = abs(vertices[:, 0]), vertices[:, 1:]
    middle_line = vertices[layout.midline]
    front = layout.midline[(middle_line[:, 1] < hinge[0]) & (middle_line[:, 2] > flat_corner[1] - _CHIN)]
    chin = flat[front[np.argmin(flat[front].sum(axis=1))]]

    out = flat - hinge
    ray = np.degrees(np.arctan2(-out[:, 1], -out[:, 0]))  # below the level forward direction
    middle = np.degrees(np.arctan2(-corner[1], -corner[0]))
    half = np.interp(aside, *_FAN)
    share = _ease((ray - middle + half) / (2 * half))
    share[ray < -90] = 0  # above and behind the hinge

    along = (angle - chin) / np.linalg.norm(angle - chin)
    below = (flat - chin) @ [along[1], -along[0]]
    begin, throat, side = _BELOW
    share *= 1 - _ease((below - begin) / (np.interp(aside, [15, 50], [throat, side]) - begin))

    ramus = np.interp(flat[:, 1], [angle[1], seeds["t"][2]], [angle[0], seeds["t"][1]])
    lobe, low, length = _BEHIND
    end = ramus + np.interp(flat[:, 1], [angle[1], angle[1] + 30], [low, lobe])
    return share * _ease((end - flat[:, 0]) / length)


def jaw_weights(p, vertices: np.ndarray) -> np.ndarray:
    """(n,) share of the mandible's motion, 0..1, of each skin vertex.

    p : the painter of `skin_groups` (rings, grid places and harmonic fields); vertices : (n, 3) mm
    """
    layout = p.layout
    ring, patch = layout.rings["mouth"], layout.patches["mouth"]
    _, away, above = lip_places()
    lips = 0.5 - 0.5 * above * np.array(_OVAL)[away]
    lining = 0.5 - 0.5 * above * np.array(_LINING)[away]
    out = _cheek(layout, vertices)
    mouth = np.zeros(layout.count, bool)
    mouth[ring[2:]], mouth[patch] = True, True
    degree = np.asarray(p.plain.sum(axis=1)).ravel()
    for k, follow in _FOLLOW.items():
        out[ring[k]] += follow * (lips - out[ring[k]])
    for k, follow in _INSIDE.items():
        out[ring[k]] = lips + follow * (lining - lips)
    out[patch[1, 1:-1]] = 0.5
    for _ in range(1):
        out = np.where(mouth, out, 0.5 * out + 0.5 * (p.plain @ out) / degree)
    out[(out < 0.004) & ~mouth] = 0
    for hole in ("eye_l", "eye_r", "ear_l", "ear_r", "nostril_l", "nostril_r"):
        out[layout.rings[hole]] = 0
        out[layout.patches[hole]] = 0
    return out
