# SPDX-License-Identifier: GPL-3.0-or-later
"""Specks: loose pieces of a scan so small that they are the scanner's, not the person's."""

import numpy as np

from ..mesh import Mesh
from .clean import components

LEAST = 150.0  # mm²: a smaller loose piece is a speck


def specks(scan: Mesh) -> np.ndarray:
    """(n,) bool: vertices of a scan (mm) in specks or in no triangle; none where all its pieces are specks."""
    if not len(scan.triangles):
        return np.zeros(len(scan.vertices), dtype=bool)
    _, label = components(scan.triangles, len(scan.vertices))
    a, b, c = scan.vertices[scan.triangles].transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    area = np.bincount(label[scan.triangles[:, 0]], area, label.max() + 1)
    return (area < LEAST)[label] & (area.max() >= LEAST)
