# SPDX-License-Identifier: GPL-3.0-or-later
"""Muscles lie between skin and bone."""

import numpy as np

from ..adapt.bone import depth_under
from ..adapt.closest import Surface
from ..anatomy.head import Head
from ..anatomy.inside import inside
from .bone import BONES

NEAR = 15.0
SLACK = 0.3  # mm: bellies rest on bone, so less than this inside it is no fault
TOUCH = 0.05  # mm: the same for the skin and the lining of the mouth


def muscle_room(head: Head) -> dict[str, tuple[float, float]]:
    """Muscle -> how far, mm, its belly comes out of the skin (or into the mouth) and how deep it dips into bone.

    Muscles that stay in their room are left out.
    """
    points = np.concatenate([m.shape.vertices for m in head.muscles])
    owner = np.repeat(np.arange(len(head.muscles)), [len(m.shape.vertices) for m in head.muscles])
    depth = depth_under(points, Surface(head.skin.vertices, head.skin.triangles), NEAR)[0]
    out = np.maximum(-depth, 0)
    out[_all(out > TOUCH, inside, points, head.skin)] = 0
    dip = np.zeros(len(points))
    for part in BONES:
        mesh = head.parts[part]
        deep, found = depth_under(points, Surface(mesh.vertices, mesh.triangles), NEAR)
        deep = np.where(found.found, deep, 0)
        deep[_all(deep > SLACK, lambda *a: ~inside(*a), points, mesh)] = 0  # round sharp edges normals mislead
        dip = np.maximum(dip, deep)
    worst = [(float(out[owner == k].max()), float(dip[owner == k].max())) for k in range(len(head.muscles))]
    return {m.name: w for m, w in zip(head.muscles, worst, strict=True) if w[0] > TOUCH or w[1] > SLACK}


def _all(rows, test, points, mesh) -> np.ndarray:
    """Indices of the ``rows`` (k,) bool for which ``test(points, vertices, triangles)`` is true."""
    rows = np.flatnonzero(rows)
    return rows[test(points[rows], mesh.vertices, mesh.triangles)]
