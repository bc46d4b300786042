# SPDX-License-Identifier: GPL-3.0-or-later
"""Four master teeth as NURBS surfaces of degree 2 (Lee, Terzopoulos and Waters 1995, section 4.3): incisor, canine,
premolar, molar; every tooth is one of them, scaled.

A master is a tube of control rings from the tip of the root over the neck (height 0) to the biting face, in units of
the tooth's own widths and of its crown's and root's lengths. Eight control points a ring: distal, distolabial, labial,
mesiolabial, mesial, mesiolingual, lingual, distolingual.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from .nurbs import NurbsSurface
from .teeth_sizes import Tooth

#: Vertices round a tooth.
AROUND = {"incisor": 14, "canine": 16, "premolar": 16, "molar": 16}
#: Roots are built no longer than this, mm: long ones would reach into the nose.
ROOT = 12.5


class Ring(NamedTuple):
    """One control ring: ``z`` height (crown lengths above the neck, root lengths below), ``wide`` half the mesiodistal
    width, ``la`` and ``li`` the labial and lingual y; ``full`` how far the corners reach out, labial and lingual (0.71
    an ellipse, 1 a box); ``rise`` added height of mesial and distal ends, corners labial, corners lingual, labial and
    lingual middle; ``dish`` the lingual middle pressed in; ``weight`` of the corners; ``distal`` how much lower and, as a
    share, narrower the distal end is."""

    z: float
    wide: float
    la: float
    li: float
    full: tuple[float, float] = (0.78, 0.78)
    rise: tuple[float, float, float, float, float] = (0, 0, 0, 0, 0)
    dish: float = 0.0
    weight: float = 1.0
    distal: tuple[float, float] = (0.0, 0.0)


def _root(wide, la, li):
    """Rings of a root that narrows to 45 % from a neck of the given size."""
    return [
        Ring(z, wide * k, la * k + shift, li * k + shift)
        for z, k, shift in ((-1.0, 0.16, 0), (-0.96, 0.40, 0), (-0.6, 0.74, 0), (-0.22, 0.93, 0))
    ]


_MASTERS = {
    "incisor": [
        *_root(0.42, 0.44, -0.44),
        Ring(0.04, 0.42, 0.46, -0.46, (0.82, 0.74), (0.06, 0.02, 0.02, 0, 0)),
        Ring(0.22, 0.455, 0.50, -0.49, (0.86, 0.70), (0.04, 0, 0, 0, 0)),
        Ring(0.42, 0.49, 0.49, -0.31, (0.90, 0.76), dish=0.02),
        Ring(0.64, 0.508, 0.41, -0.15, (0.93, 0.90), dish=0.05, distal=(0.0, 0.0)),
        Ring(0.84, 0.515, 0.29, -0.06, (0.95, 0.95), dish=0.03, distal=(0.02, 0.01)),
        Ring(0.97, 0.51, 0.19, 0.00, (0.96, 0.96), (-0.02, 0, 0, 0, 0), distal=(0.05, 0.04)),
        Ring(1.0, 0.48, 0.13, 0.04, (0.95, 0.95), (-0.03, 0, 0, 0, 0), distal=(0.06, 0.06)),
    ],
    "canine": [
        *_root(0.39, 0.44, -0.44),
        Ring(0.04, 0.39, 0.46, -0.46, (0.76, 0.74), (0.05, 0.02, 0.02, 0, 0)),
        Ring(0.22, 0.42, 0.51, -0.51, (0.76, 0.72), (0.03, 0, 0, 0, 0)),
        Ring(0.42, 0.47, 0.50, -0.40, (0.76, 0.74), dish=-0.02),
        Ring(0.62, 0.51, 0.43, -0.24, (0.76, 0.84), (-0.03, 0, 0, 0, 0), dish=0.0),
        Ring(0.84, 0.50, 0.31, -0.12, (0.74, 0.80), (-0.17, -0.07, -0.07, 0, 0), distal=(0.04, 0.0)),
        Ring(1.01, 0.42, 0.18, -0.02, (0.70, 0.70), (-0.30, -0.15, -0.15, 0, 0), distal=(0.06, 0.0)),
        Ring(1.06, 0.36, 0.13, 0.03, (0.70, 0.70), (-0.33, -0.17, -0.17, 0, 0), distal=(0.06, 0.0)),
    ],
    "premolar": [
        *_root(0.37, 0.44, -0.44),
        Ring(0.04, 0.37, 0.455, -0.455, (0.80, 0.78), (0.04, 0, 0, 0, 0)),
        Ring(0.26, 0.43, 0.505, -0.50, (0.80, 0.78)),
        Ring(0.50, 0.49, 0.50, -0.51, (0.80, 0.80)),
        Ring(0.72, 0.51, 0.43, -0.46, (0.80, 0.80), (0, 0, 0, 0.02, 0.0)),
        Ring(0.90, 0.47, 0.35, -0.38, (0.78, 0.78), (-0.10, -0.05, -0.07, 0.12, 0.02)),
        Ring(0.95, 0.38, 0.23, -0.26, (0.78, 0.78), (-0.14, -0.06, -0.08, 0.18, 0.06)),
        Ring(0.86, 0.31, 0.12, -0.14, (0.76, 0.76), (-0.10, -0.06, -0.06, 0.10, 0.05)),
        Ring(0.73, 0.24, 0.015, -0.015, (0.8, 0.8), (-0.02, 0, 0, 0, 0)),
    ],
    "molar": [
        *_root(0.41, 0.45, -0.45),
        Ring(0.04, 0.41, 0.46, -0.46, (0.88, 0.86), (0.04, 0, 0, 0, 0)),
        Ring(0.28, 0.455, 0.505, -0.50, (0.90, 0.88)),
        Ring(0.52, 0.495, 0.51, -0.51, (0.90, 0.88)),
        Ring(0.74, 0.505, 0.45, -0.46, (0.90, 0.88), (0, 0.03, 0.03, -0.02, -0.02)),
        Ring(0.90, 0.465, 0.37, -0.38, (0.92, 0.90), (-0.13, 0.11, 0.08, -0.09, -0.08), weight=1.5, distal=(0.05, 0.0)),
        Ring(0.92, 0.39, 0.27, -0.28, (0.86, 0.84), (-0.24, 0.17, 0.14, -0.15, -0.14), weight=1.8, distal=(0.08, 0.0)),
        Ring(0.79, 0.30, 0.16, -0.17, (0.72, 0.70), (-0.15, 0.10, 0.08, -0.15, -0.14), weight=1.4, distal=(0.05, 0.0)),
        Ring(0.60, 0.20, 0.02, -0.02, (0.8, 0.8), (0.0, 0.03, 0.03, -0.02, -0.02)),
    ],
}

#: Rows of vertices: parameters as shares of the control rows from the root's tip to the biting face.
_ROWS = {
    "incisor": (0, 0.05, 0.12, 0.21, 0.38, 0.48, 0.56, 0.66, 0.76, 0.86, 0.94, 1),
    "canine": (0, 0.05, 0.12, 0.21, 0.38, 0.48, 0.56, 0.66, 0.76, 0.86, 0.94, 1),
    "premolar": (0, 0.05, 0.11, 0.19, 0.35, 0.45, 0.54, 0.63, 0.72, 0.80, 0.90, 1),
    "molar": (0, 0.05, 0.11, 0.19, 0.35, 0.45, 0.54, 0.63, 0.72, 0.80, 0.90, 1),
}


def control_net(form: str) -> tuple[np.ndarray, np.ndarray]:
    """Control points (rings, 8, 3) and weights (rings, 8) of a master: ``incisor``, ``canine``, ``premolar``, ``molar``."""
    net, weights = [], []
    for ring in _MASTERS[form]:
        middle = (ring.la + ring.li) / 2
        front, back = ring.la - middle, ring.li - middle
        a, b = ring.full
        ends, corner_la, corner_li, mid_la, mid_li = ring.rise
        x = np.array([1, a, 0, -a, -1, -b, 0, b]) * ring.wide
        y = middle + np.array([0, a * front, front, a * front, 0, b * back, back, b * back])
        y[6] += ring.dish
        z = ring.z + np.array([ends, corner_la, mid_la, corner_la, ends, corner_li, mid_li, corner_li])
        far = x > 0
        x, z = np.where(far, x * (1 - ring.distal[1]), x), z - np.where(far, ring.distal[0] * x / ring.wide, 0)
        net.append(np.stack([x, y, z], axis=1))
        weights.append([1, ring.weight, 1, ring.weight] * 2)
    return np.array(net), np.array(weights, float)


@cache
def master(form: str) -> NurbsSurface:
    """The NURBS surface of a master, its crown 1 wide, 1 deep and 1 high."""
    net, weights = control_net(form)
    surface = NurbsSurface.tube(net, weights)
    for _ in range(3):  # the surface runs inside its net: scale the net until the surface has the size
        points = surface.grid(np.linspace(0, 1, 241), np.linspace(0, 1, 121)[:-1]).reshape(-1, 3)
        crown = points[points[:, 2] > 0.02]
        low, high = crown.min(axis=0), crown.max(axis=0)
        net = net * np.append(1 / (high - low)[:2], 1.0)
        up = net[..., 2] > 0
        net[..., 2] = np.where(up, net[..., 2] / high[2], net[..., 2])
        surface = NurbsSurface.tube(net, weights)
    return surface


@cache
def _neck(form):
    """(2,) widths of a master at its neck."""
    rings = master(form).grid(np.linspace(0, 1, 241), np.linspace(0, 1, 65)[:-1])
    return np.ptp(rings[np.abs(rings[..., 2].mean(axis=1)).argmin(), :, :2], axis=0)


def built_root(tooth: Tooth) -> float:
    """mm from the neck to the tip of the root as built."""
    return min(tooth.root, ROOT)


def tooth_points(tooth: Tooth, rows, columns) -> np.ndarray:
    """(len(rows), len(columns), 3) mm on a tooth's surface at the master's parameters.

    Axes: x distal, y labial, z from the neck (0) to the crown's edge; the root goes down to ``-built_root(tooth)``.
    """
    points = master(tooth.form).grid(rows, columns)
    z = points[..., 2]
    share = np.clip(z / 0.6, 0, 1)
    share = share * share * (3 - 2 * share)
    scale = []
    for axis, whole, narrow in ((0, tooth.md, tooth.md_neck), (1, tooth.ll, tooth.ll_neck)):
        scale.append(whole * (share + (1 - share) * narrow / (whole * _neck(tooth.form)[axis])))
    return np.stack(
        [points[..., 0] * scale[0], points[..., 1] * scale[1], z * np.where(z > 0, tooth.crown, built_root(tooth))], -1
    )


def tooth_mesh(tooth: Tooth) -> tuple[np.ndarray, np.ndarray]:
    """One closed tooth: vertices (n, 3) mm, ring by ring from the root's tip, and faces (m, 4), outward.

    The ends are closed by strips from side to side, so that the biting edge is a clean row of quads.
    """
    rows, around = _ROWS[tooth.form], AROUND[tooth.form]
    vertices = tooth_points(tooth, np.array(rows), np.arange(around) / around).reshape(-1, 3)
    return vertices, tube_faces(len(rows), around)


def tube_faces(rows: int, around: int) -> np.ndarray:
    """Faces (m, 4) of ``rows`` rings, counter-clockwise seen from their end, closed at both ends by strips."""
    j = np.arange(around)
    k = (j + 1) % around
    faces = [np.stack([i * around + j, i * around + k, (i + 1) * around + k, (i + 1) * around + j], 1)
             for i in range(rows - 1)]  # fmt: skip
    a = np.arange(1, around // 2 - 1)
    strip = np.concatenate([[[0, 1, around - 1, -1]], np.stack([a, a + 1, around - a - 1, around - a], axis=1),
                            [[around // 2 - 1, around // 2, around // 2 + 1, -1]]])  # fmt: skip
    last = np.where(strip >= 0, strip + (rows - 1) * around, -1)
    first = np.where(strip[:, 3:] >= 0, strip[:, [3, 2, 1, 0]], strip[:, [2, 1, 0, 3]])
    return np.concatenate([*faces, last, first]).astype(np.int32)
