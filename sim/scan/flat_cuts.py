# SPDX-License-Identifier: GPL-3.0-or-later
"""Flat ends of a scan: where a volume of tomography stops, or the base that a bust was given to stand on.

They are no skin. A head has no flat places of that size, let alone with all of it on one side.
"""

import numpy as np

BINS = 24  # along each axis of a normal: about seven degrees where the normals' sphere lies flat
LEAST = 4000.0  # mm² of a cut: 63 mm squared; the flattest places of heads have 2000
ALIKE = np.cos(np.radians(8))  # between the normals of its triangles and its own
THICK = 1.0  # mm across which it is flat
BEYOND = 0.02  # share of the surface that may lie on the far side: specks
ROUND = 3.0  # mm beside it that smoothing has rounded


def flat_cuts(vertices, triangles, normals, area) -> np.ndarray:
    """(k, 4) planes of the flat ends of a surface: unit normal, outward, and how far along it, mm.

    vertices (n, 3) mm, triangles (m, 3), their unit normals (m, 3) and area (m,) mm²
    """
    cell = np.clip(((normals + 1) * (BINS / 2)).astype(np.int64), 0, BINS - 1) @ np.array([BINS * BINS, BINS, 1])
    filled = np.bincount(cell, area, BINS**3)
    planes = np.zeros((0, 4))
    # Most of a cut lies in four cells at most.
    for which in np.flatnonzero(filled > LEAST / 4):
        plane = _plane(vertices, triangles, normals, area, cell == which)
        if plane is not None and (planes[:, :3] @ plane[:3] < ALIKE).all():
            planes = np.vstack([planes, plane])
    return planes


def beyond(planes, points) -> np.ndarray:
    """(p,) bool: which of ``points`` (p, 3) mm lie on the flat ends ``planes`` (k, 4), on their rounded edges or
    farther out."""
    return (points @ planes[:, :3].T > planes[:, 3] - THICK - ROUND).any(axis=1)


def _plane(vertices, triangles, normals, area, some):
    """The plane (4,) of the flat end that the triangles ``some`` (m,) bool belong to; None: there is none."""
    for _ in range(3):
        normal = area[some] @ normals[some]
        normal /= np.linalg.norm(normal)
        some = normals @ normal > ALIKE
        if not some.any():
            return None
    middle = (vertices @ normal)[triangles].mean(axis=1)
    # It lies where most of what faces that way does.
    order = np.flatnonzero(some)
    order = order[np.argsort(middle[order])]
    total = np.append(0.0, np.cumsum(area[order]))
    within = total[1:] - total[np.searchsorted(middle[order], middle[order] - THICK)]
    top = middle[order][within.argmax()]
    if within.max() < LEAST or area[middle > top + THICK].sum() > BEYOND * area.sum():
        return None
    return np.append(normal, top)
