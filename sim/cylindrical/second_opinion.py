# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks found in another way, weighed against the features of the range map: two that err differently, err less."""

import numpy as np

from ..adapt.closest import Surface
from ..adapt.thin_plate_spline import similarity
from ..anatomy.head import Head
from ..mesh import Mesh
from ..progress import Work
from .features import VAGUE, search_features
from .pose import Pose

#: Weight of the map's feature. Creases that run level and the tip of the nose are sharp in the map; the lower rim of the
#: chin, the wings of the nose and the top of the ear lie where it is steep.
USUAL, SHARP, DULL = 0.5, 0.7, 0.2
SHARP_MARKS = {"prn", "ls", "sto", "or_l", "or_r", "obi_l", "obi_r"}
DULL_MARKS = {"gn", "v", "op", "sa_l", "sa_r", "al_l", "al_r"}
#: How sure a landmark must be to say where the face is; mm within which the mean is put back on the surface.
TOLD, NEAR = 0.3, 4.0
#: mm on a head of the reference's size: a feature farther off is that of something else, another head for one.
ASTRAY = 25.0


def weighed(
    mesh: Mesh, positions: dict[str, np.ndarray], confidence: dict[str, float], reference: Head, surface: Surface
) -> Work:
    """Work returning ``positions`` (name -> (3,) mm), each moved towards where the range map of ``mesh`` has it.

    confidence : name -> 0..1; surface : that of the mesh, on which what was on it stays. Fewer than six sure landmarks
    place no face: then the positions are returned as they are.
    """
    home = reference.landmark_positions()
    told = [n for n in positions if n in home and n not in VAGUE and confidence.get(n, 0) > TOLD]
    if len(told) < 6:
        return positions
    matrix, shift = similarity(np.array([home[n] for n in told]), np.array([positions[n] for n in told]))
    scale = float(np.cbrt(np.linalg.det(matrix)))
    features = yield from search_features(mesh, reference, Pose(matrix / scale, shift, scale, 0.0))
    out = {}
    for name, place in positions.items():
        share = SHARP if name in SHARP_MARKS else DULL if name in DULL_MARKS else USUAL
        off = features.positions.get(name, place) - place
        out[name] = place + share * off if np.linalg.norm(off) < ASTRAY * scale else place
    names = list(out)
    before = surface.closest(np.array([positions[n] for n in names]), NEAR)
    after = surface.closest(np.array([out[n] for n in names]), NEAR)
    for k, name in enumerate(names):
        if before.found[k] and after.found[k] and before.distance[k] < 1.0:
            out[name] = after.points[k]
    return out
