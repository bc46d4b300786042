# SPDX-License-Identifier: GPL-3.0-or-later
"""Flesh that the skin's motion squeezes together swells, as it keeps its volume: a smile's round cheeks.

The simulated tissue is a layer of skin over what lies deeper. The flesh between that and the bone is pressed or drawn
out along the face as the skin over it, so its thickness changes by the same share as the skin's area, the other way.
"""

import numpy as np
from scipy.sparse import identity

from ..adapt.smooth_system import laplacian
from ..anatomy.head import Head
from ..mesh import vertex_normals
from .jaw_floor import held_up, pushed_out

#: Thickness of the flesh, mm: that over the second upper molar, about (Stephan and Simpson 2008, as recalled).
FLESH = 26.0
ROUNDS = 60  # smoothing steps: flesh spreads what presses it over about its own thickness
LEAVES = ("inner", "lip_upper", "lip_lower", "nose", "neck", "scalp", "forehead")


def fleshed(head: Head, displacement, opening: float = 0.0) -> np.ndarray:
    """The displacement (n, 3) mm of the simulated skin with what the flesh under it adds and what it does not let happen.

    opening : the jaw's, 0..1, that is part of the displacement
    """
    displacement = borne(head, displacement) + swelling(head, displacement)
    return held_up(head, displacement) if opening == 0 else pushed_out(head, displacement, opening)


def borne(head: Head, displacement) -> np.ndarray:
    """The displacement (n, 3) mm without what lets the cheeks sink: flesh and teeth behind them bear them."""
    normals = vertex_normals(head.skin.vertices, head.skin.triangles)
    cheek = np.maximum(head.groups["cheek_l"], head.groups["cheek_r"]).astype(float)
    sinking = np.minimum(np.einsum("ij,ij->i", displacement, normals), 0)
    return displacement - (cheek * sinking)[:, None] * normals


def swelling(head: Head, displacement) -> np.ndarray:
    """(n, 3) mm by which the flesh under a displaced skin, ``displacement`` (n, 3) mm, moves it out or lets it sink."""
    vertices, triangles = head.skin.vertices, head.skin.triangles
    strain = area_at(vertices + displacement, triangles) / np.maximum(area_at(vertices, triangles), 1e-9) - 1
    there = np.ones(len(vertices))
    for name in LEAVES + tuple(f"{part}_{side}" for part in ("lid_upper", "lid_lower", "ear") for side in "lr"):
        there *= 1 - np.asarray(head.groups[name], dtype=float)
    strain = np.where(there > 0.5, strain, 0)
    smooth = identity(len(vertices)) - 0.5 * laplacian(vertices, head.skin.faces)
    for _ in range(ROUNDS):
        strain, there = smooth @ strain, smooth @ there
    return -(FLESH * strain * np.clip(there, 0, 1))[:, None] * vertex_normals(vertices, triangles)


def area_at(vertices, triangles) -> np.ndarray:
    """(n,) mm²: the area of the triangles at each vertex."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    area = np.repeat(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2, 3)
    return np.bincount(triangles.ravel(), area, minlength=len(vertices))
