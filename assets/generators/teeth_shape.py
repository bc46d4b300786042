# SPDX-License-Identifier: GPL-3.0-or-later
"""Crowns of teeth as B-spline surfaces of degree 2 (Lee, Terzopoulos and Waters 1995, 4.3): incisor, canine, premolar,
molar. Sizes after Wheeler's Dental Anatomy, tables of the permanent teeth."""

from typing import NamedTuple

import numpy as np

AROUND = 12
UP = 7


class Tooth(NamedTuple):
    """A permanent tooth: ``form`` and crown length, mesiodistal and labiolingual width of crown and cervix, mm."""

    form: str
    length: float
    md: float
    md_neck: float
    ll: float
    ll_neck: float


UPPER = (
    Tooth("incisor", 10.5, 8.5, 7.0, 7.0, 6.0),
    Tooth("incisor", 9.0, 6.5, 5.0, 6.0, 5.0),
    Tooth("canine", 10.0, 7.5, 5.5, 8.0, 7.0),
    Tooth("premolar", 8.5, 7.0, 5.0, 9.0, 8.0),
    Tooth("premolar", 8.5, 7.0, 5.0, 9.0, 8.0),
    Tooth("molar", 7.5, 10.0, 8.0, 11.0, 10.0),
    Tooth("molar", 7.0, 9.0, 7.0, 11.0, 10.0),
    Tooth("molar", 6.5, 8.5, 6.5, 10.0, 9.5),
)
LOWER = (
    Tooth("incisor", 9.0, 5.0, 3.5, 6.0, 5.3),
    Tooth("incisor", 9.5, 5.5, 4.0, 6.5, 5.8),
    Tooth("canine", 11.0, 7.0, 5.5, 7.5, 7.0),
    Tooth("premolar", 8.5, 7.0, 5.0, 7.5, 6.5),
    Tooth("premolar", 8.0, 7.0, 5.0, 8.0, 7.0),
    Tooth("molar", 7.5, 11.0, 9.0, 10.5, 9.0),
    Tooth("molar", 7.0, 10.5, 8.0, 10.0, 9.0),
    Tooth("molar", 7.0, 10.0, 7.5, 9.5, 9.0),
)

#: Control rings from under the gum to the biting edge: height as a share of the crown's length, share of the crown's
#: mesiodistal and labiolingual width (0 = cervix, 1 = widest), labial shift as a share of the labiolingual width.
_RINGS = {
    "incisor": [(-0.28, -0.25, -0.2, 0.0), (0.0, 0.0, 0.0, 0.02), (0.35, 0.55, 0.1, 0.07), (0.70, 0.95, -2.6, 0.22),
                (0.93, 1.0, -4.4, 0.26), (1.0, 0.86, -5.0, 0.25)],
    "canine": [(-0.28, -0.2, -0.2, 0.0), (0.0, 0.0, 0.0, 0.02), (0.35, 0.8, 0.8, 0.05), (0.62, 1.0, -0.6, 0.14),
               (0.85, 0.2, -2.6, 0.20), (0.99, -1.2, -4.6, 0.20)],
    "premolar": [(-0.28, -0.2, -0.2, 0.0), (0.0, 0.0, 0.0, 0.0), (0.40, 0.95, 0.9, 0.02), (0.72, 1.0, 0.6, 0.0),
                 (0.96, 0.5, -0.6, 0.0), (0.90, -0.9, -3.0, 0.0)],
    "molar": [(-0.30, -0.2, -0.2, 0.0), (0.0, 0.0, 0.0, 0.0), (0.45, 0.95, 1.0, 0.0), (0.75, 1.0, 0.8, 0.0),
              (0.96, 0.2, -0.6, 0.0), (0.86, -2.2, -3.4, 0.0)],
}  # fmt: skip

#: Cusps: lift of the upper control rings around the tooth as (direction in turns, share of the crown's length).
_CUSPS = {
    "incisor": (),
    "canine": (),
    "premolar": ((0.25, 0.14), (0.75, 0.08)),
    "molar": ((0.125, 0.10), (0.375, 0.10), (0.625, 0.10), (0.875, 0.10)),
}


def crown(tooth: Tooth) -> tuple[np.ndarray, np.ndarray]:
    """A closed crown: vertices (n, 3) mm and faces (m, 4).

    Axes: x mesiodistal, y labial, z from the cervix (0) to the biting edge (the crown's length). The surface goes a
    little beyond the cervix, into the gum.
    """
    net = _control_net(tooth)
    rows = _spline(net, UP, closed=False)
    rings = _spline(rows.transpose(1, 0, 2), AROUND, closed=True).transpose(1, 0, 2)
    bottom, top = rings[0].mean(axis=0), rings[-1].mean(axis=0)
    if tooth.form in ("premolar", "molar"):
        top = top - [0, 0, 0.05 * tooth.length]
    if tooth.form == "canine":
        top = top + [0, 0, 0.03 * tooth.length]
    vertices = np.concatenate([rings.reshape(-1, 3), [bottom, top]])
    j = np.arange(AROUND)
    k = (j + 1) % AROUND
    none = np.full(AROUND, -1)
    faces = [np.stack([np.full(AROUND, AROUND * UP), k, j, none], axis=1)]
    for i in range(UP - 1):
        a, b = i * AROUND, (i + 1) * AROUND
        faces.append(np.stack([a + j, a + k, b + k, b + j], axis=1))
    a = (UP - 1) * AROUND
    faces.append(np.stack([np.full(AROUND, AROUND * UP + 1), a + j, a + k, none], axis=1))
    return vertices, np.concatenate(faces).astype(np.int32)


def _control_net(tooth):
    """(rings, 8, 3) control points."""
    turn = np.arange(8) / 8
    # A square polygon gives a rounder box than a circle would.
    x, y = np.cos(2 * np.pi * turn), np.sin(2 * np.pi * turn)
    box = np.maximum(np.abs(x), np.abs(y)) ** -0.45
    net = []
    for height, md, ll, shift in _RINGS[tooth.form]:
        wide = max(tooth.md_neck + md * (tooth.md - tooth.md_neck), 1.2) / 2
        deep = max(tooth.ll_neck + ll * (tooth.ll - tooth.ll_neck), 1.7) / 2
        z = np.full(8, height * tooth.length)
        for direction, lift in _CUSPS[tooth.form]:
            if height > 0.8:
                near = np.abs((turn - direction + 0.5) % 1 - 0.5)
                z += lift * tooth.length * np.clip(1 - near / 0.126, 0, 1) * (1.0 if height > 0.92 else 0.5)
        # 1.12: a quadratic spline runs inside its control polygon.
        net.append(np.stack([1.12 * wide * x * box, 1.12 * deep * y * box + shift * tooth.ll * 0.5, z], axis=1))
    return np.array(net)


def _spline(control, count, closed):
    """(count, ...) points on the uniform B-spline of degree 2 over ``control`` (k, ...); open ones reach their ends."""
    control = np.asarray(control, float)
    if closed:
        at = np.arange(count) * len(control) / count
        ring = np.concatenate([control, control[:2]])
    else:
        ring = np.concatenate([2 * control[:1] - control[1:2], control, 2 * control[-1:] - control[-2:-1]])
        at = np.linspace(0.5, len(control) - 0.5, count)
    i = np.minimum(at.astype(int), len(ring) - 3)
    t = (at - i).reshape(-1, *([1] * (control.ndim - 1)))
    return 0.5 * ((1 - t) ** 2 * ring[i] + (1 + 2 * t - 2 * t * t) * ring[i + 1] + t * t * ring[i + 2])
