# SPDX-License-Identifier: GPL-3.0-or-later
"""The tongue put out between the teeth: it slides forward over the lower incisors, flattens and lengthens.

A plain deformation in the mandible's frame, without tissue: the tongue is a muscular hydrostat (its volume stays while
it lengthens: Kier and Smith 1985), so it narrows in height as it gets longer.
"""

import numpy as np

OUT = 32.0  # mm that the tip slides forward
ROOT = 0.35  # share of that at the tongue's root
FLAT = 0.4  # share of the tip's height that it loses
OVER = 3.5  # mm from the edge of the lower incisors to the middle of the tongue that lies on it
MIDDLE = 6.0  # mm from the midline within which the incisors stand


def tongue_out(vertices: np.ndarray, teeth_lower: np.ndarray, amount: float) -> np.ndarray:
    """(n, 3) mm: the tongue's ``vertices`` (n, 3) put out by ``amount`` 0..1 over ``teeth_lower`` (t, 3), jaw at rest."""
    if amount <= 0 or not len(teeth_lower):
        return vertices.copy()
    back, tip = vertices[:, 1].max(), vertices[:, 1].min()
    along = (back - vertices[:, 1]) / (back - tip)
    front = np.clip((along - 0.1) / 0.5, 0, 1)  # all of what comes to lie on the teeth and beyond
    front = front * front * (3 - 2 * front)
    middle = np.polynomial.Polynomial.fit(along, vertices[:, 2], 3)(along)
    incisors = teeth_lower[np.abs(teeth_lower[:, 0]) < MIDDLE]
    lift = incisors[:, 2].max() + OVER - middle
    out = vertices.copy()
    out[:, 1] -= amount * OUT * (ROOT + (1 - ROOT) * along)
    out[:, 2] += amount * front * (lift - FLAT * (vertices[:, 2] - middle))
    return out
