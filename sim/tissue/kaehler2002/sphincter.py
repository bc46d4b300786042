# SPDX-License-Identifier: GPL-3.0-or-later
"""Circular muscles draw together about a centre; the two halves of the orbicularis oris have centres of their own that
move along a line, for lips that protrude or draw back (Kähler et al. 2002, section 3; contraction after 2001).

Contracted by c, a point p goes to p* + (1 - c) (p - p*), with p* the centre. A ring that lies on bone round an opening,
the orbicularis oculi, keeps to its surface: the way along the outward normal is left out.
"""

import numpy as np


def moved_centre(centre: np.ndarray, line: np.ndarray, shift) -> np.ndarray:
    """The centre (..., 3) moved by ``shift`` (...) mm along the unit ``line`` (..., 3): positive protrudes."""
    return centre + np.asarray(shift)[..., None] * line


def drawn_together(points, centre, contraction, shift=None, line=None, normal=None) -> np.ndarray:
    """(k, 3) mm: points (k, 3) drawn by ``contraction`` (k,) towards ``centre`` (k, 3), all carried along with a centre
    that moves by ``shift`` (k,) mm along ``line`` (k, 3); ``normal`` (k, 3): unit, zero where a point may leave its surface.
    """
    way = -np.asarray(contraction)[:, None] * (points - centre)
    if normal is not None:
        way = way - np.einsum("ij,ij->i", way, normal)[:, None] * normal
    if shift is not None:
        way = way + moved_centre(centre, line, shift) - centre
    return points + way
