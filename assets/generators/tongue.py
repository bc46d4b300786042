# SPDX-License-Identifier: GPL-3.0-or-later
"""The tongue: a closed soft body resting in the lower arch."""

import numpy as np

from ...sim.mesh import Mesh
from .skull_field import curve
from .teeth import Mouth

AROUND, ALONG = 16, 14


def make_tongue(skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray], teeth_lower: Mesh) -> Mesh:
    """The tongue's mesh, its tip behind the lower incisors, inside the teeth and the lining of the mouth."""
    mouth = Mouth(skin, groups, landmarks)
    gum = teeth_lower.vertices
    tip = gum[np.abs(gum[:, 0]) < 2.5, 1].max() + 1.5
    back = mouth.back - 2.0
    low, high = mouth.floor + 3.0, mouth.line + 3.2
    share = np.linspace(0, 1, ALONG)
    # Half width, back of the tongue, underside: from tip to root.
    stations = np.column_stack([np.linspace(tip, back, 6), _half_width(gum, np.linspace(tip, back, 6)),
                                [high - 6.5, high - 3.0, high - 0.6, high, high - 1.0, high - 4.0],
                                [high - 9.0, low + 1.5, low, low, low, low + 1.0]])  # fmt: skip
    line = curve(stations, ALONG)
    turn = 2 * np.pi * np.arange(AROUND) / AROUND
    c, s = np.cos(turn), np.sin(turn)
    middle, half = (line[:, 2] + line[:, 3]) / 2, (line[:, 2] - line[:, 3]) / 2
    groove = -0.9 * np.exp(-((c / 0.25) ** 2)) * (s > 0) * np.sin(np.pi * share)[:, None]
    x = line[:, 1, None] * (np.sign(c) * np.abs(c) ** 0.8)[None]
    z = middle[:, None] + half[:, None] * (np.sign(s) * np.abs(s) ** 0.8)[None] + groove
    y = np.repeat(line[:, :1], AROUND, axis=1)
    rings = np.stack([x, y, z], axis=2)
    tip_point = [0, tip - 0.8, middle[0]]
    root = [0, back + 0.8, middle[-1]]
    vertices = np.concatenate([rings.reshape(-1, 3), [tip_point, root]])
    j = np.arange(AROUND)
    k = (j + 1) % AROUND
    none = np.full(AROUND, -1)
    faces = [np.stack([np.full(AROUND, ALONG * AROUND), j, k, none], axis=1)]
    for i in range(ALONG - 1):
        a, b = i * AROUND, (i + 1) * AROUND
        faces.append(np.stack([a + j, b + j, b + k, a + k], axis=1))
    a = (ALONG - 1) * AROUND
    faces.append(np.stack([np.full(AROUND, ALONG * AROUND + 1), a + k, a + j, none], axis=1))
    faces = np.concatenate(faces).astype(np.int32)
    return Mesh(vertices, faces, material=np.zeros(len(faces), np.int16))


def _half_width(gum, y):
    """Half the free width between the lower teeth and gums at each ``y``, less 1.5 mm; rounded at the tip."""
    inner = []
    for at in y:
        near = np.abs(gum[:, 1] - at) < 4
        side = np.abs(gum[near, 0])
        inner.append(max(side.min() - 1.5, 4.0) if near.any() and side.min() > 2 else 5.0)
    inner = np.minimum.accumulate(np.array(inner)[::-1])[::-1]
    inner[0] = min(inner[0], 4.5)
    return inner
