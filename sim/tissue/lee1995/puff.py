# SPDX-License-Identifier: GPL-3.0-or-later
"""Cheeks blown up: Lee, Terzopoulos and Waters 1995, section 5: "applying outwardly directed radial forces to inflate the
deformable cheeks"."""

import numpy as np

from ...anatomy.head import Head
from ..geometry import cotangent_stiffness, smoothed
from ..structures import Layers

_FADE = 8.0  # mm


def radial(points: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """(k, 3) unit vectors away from ``centre`` (3,)."""
    out = points - centre
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-9)


def puff_forces(head: Head, layers: Layers) -> np.ndarray:
    """(3 n, 3) forces of unit size on the fascia of cheeks and lips, away from the middle of each half of the mouth."""
    n = len(layers.area)
    force = np.zeros((3 * n, 3))
    groups = {k: np.asarray(w, float) for k, w in head.groups.items()}
    fascia = layers.nodes[n : 2 * n]
    # bone holds what lies on it: the force fades out where bone begins
    boneless = (~layers.bony & layers.free[:n]).astype(float)
    laplacian = cotangent_stiffness(layers.nodes[:n], head.skin.triangles)
    inflated = np.clip(2 * smoothed(boneless, laplacian, layers.area, _FADE) - 1, 0, 1) * layers.free[:n]
    for side in "lr":
        cheek = inflated * groups.get(f"cheek_{side}", np.zeros(n))
        if cheek.sum() < 1e-6:
            continue
        # the air stands between cheek and teeth: the centre lies as deep behind the cheek as the cheek is wide
        middle = cheek @ fascia / cheek.sum()
        spread = np.sqrt(cheek @ ((fascia - middle) ** 2).sum(axis=1) / cheek.sum())
        toward = np.array([-np.sign(middle[0]), 0.5, 0.0]) / np.sqrt(1.25)
        force[n : 2 * n] += cheek[:, None] * radial(fascia, middle + spread * toward)
    return force
