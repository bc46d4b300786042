# SPDX-License-Identifier: GPL-3.0-or-later
"""Volume preservation inside the equations of motion (Kähler et al. 2002, 4.2).

The paper says only that the constraint is part of the global solution and needs no local criteria. Here: the tissue
between a triangle of skin and the three feet below is a prism; its pressure k (V - V_0) / V_0 acts along the gradient
of its volume, on the feet too, which pass it on to muscle and bone. So it has an energy and no momentum of its own.
"""

import numpy as np

from ..volume import corner_gather, prism_volumes, volume_energy, volumes_and_gradients

__all__ = ["build_prisms", "corner_gather", "prism_stiffness", "prism_volumes", "volume_energy"]


def build_prisms(nodes: np.ndarray, triangles: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Prisms (t, 6) over ``triangles`` of the n skin vertices and the feet below, nodes (2 n, 3) or more, and their mm³.

    Those that do not move at all and those pressed flat by a sharp fold (under 0.4 mm high) are left out.
    """
    n = len(free)
    prisms = np.concatenate([triangles, triangles + n], axis=1)
    found = prism_volumes(nodes, prisms)
    a, b, c = (nodes[triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    kept = free[triangles].any(axis=1) & (found > 0.4 * area)
    return prisms[kept], found[kept]


def prism_stiffness(nodes, prisms, rest_volume, k: float, count: int) -> np.ndarray:
    """(count,) a bound on the stiffness that the volume of prisms lends each of the first ``count`` nodes."""
    gradient = volumes_and_gradients(nodes, prisms)[1]  # (6, 3, t)
    size = np.sqrt((gradient**2).sum(axis=1))  # (6, t)
    # a row of the Hessian k/V g_i g_j^T, summed in size over j
    row = k / rest_volume * size * size.sum(axis=0)
    return np.bincount(prisms.T.ravel(), row.ravel(), minlength=count)[:count]
