# SPDX-License-Identifier: GPL-3.0-or-later
"""The braincase: vault, brow, temporal fossa under the temporal line, and the base with its joints and processes."""

import numpy as np
from scipy.spatial import cKDTree

from .skull_depth import BoneSpace
from .skull_field import carve, curve, ellipsoid, join, meet, tube
from .skull_marks import SkullMarks


class Vault:
    """The braincase of the left half as a field."""

    def __init__(self, space: BoneSpace, marks: SkullMarks):
        self.space, self.marks = space, marks
        at = space.targets
        g, op, eu, v = at["g"], at["op"], at["eu_l"], at["v"]
        self.middle = np.array([0.0, (g[1] + op[1]) / 2, 0.36 * v[2]])
        # Larger than life: the skin's depth trims it.
        self.radii = np.array([eu[0] + 3, (op[1] - g[1]) / 2 + 4, v[2] - self.middle[2] + 4])
        self._line = cKDTree(marks.line)
        self._chord = np.roll(marks.line, -1, axis=0) - marks.line

    def temple(self, p):
        """(n,) mm how far within the temporal line a point lies as seen from the side, negative without."""
        distance, near = self._line.query(p[:, 1:])
        off = p[:, 1:] - self.marks.line[near]
        turn = self._chord[near]
        inside = turn[:, 0] * off[:, 1] - turn[:, 1] * off[:, 0]
        return np.where(inside < 0, distance, -distance)

    def case(self, p):
        """(n,) mm, vault and base before the temples are hollowed."""
        at, base = self.space.targets, self.marks.base
        po = at["po_l"]
        case = ellipsoid(p, self.middle, self.radii)
        case = meet(case, base - p[:, 2], 14)
        # The nuchal plane rises to the occipital protuberance, the floor under the frontal lobe to the brow.
        case = meet(case, (p - [0, po[1] + 36, base - 1]) @ np.array([0.0, 0.50, -0.866]), 16)
        case = meet(case, (p - [0, po[1] - 32, base]) @ np.array([0.0, -0.62, -0.78]), 20)
        # The base narrows below the temporal bone.
        return meet(case, (p - [po[0] - 1.0, po[1] + 30, base + 8]) @ np.array([0.62, 0.0, -0.78]), 16)

    def hollowed(self, p, case):
        """``case`` with the temporal fossa: a step under the temporal line, deep behind the cheekbone."""
        at, m = self.space.targets, self.marks
        edge = self.temple(p)
        step = 3.0 * _smooth(edge / 4.5) * _smooth((p[:, 0] - 18) / 14)
        case = case + step
        zy = at["zy_l"]
        front = m.rim[:, 1].mean()
        fossa = ellipsoid(p, [zy[0] + 15, front + 32, m.eye[2] - 1], (31.5, 27, 33))
        high = ellipsoid(p, [zy[0] + 24, front + 38, m.eye[2] + 20], (37, 35, 36))
        low = ellipsoid(p, [zy[0] - 8, front + 33, m.base - 4], (17, 21, 26))
        return carve(case, join(join(fossa, high, 14), low, 10), 9)

    def brow(self, p):
        """(n,) mm, glabella and superciliary arch."""
        at, os = self.space.targets, self.space.targets["os_l"]
        g = at["g"]
        arch = tube(
            p,
            [g + [0, 7.0, -2.5], [9, g[1] + 6.4, g[2] - 2.5], [19, os[1] + 6.0, os[2] + 4.5], os + [3, 7.5, 5.0]],
            [7.0, 6.6, 5.8, 4.2],
        )
        return arch

    def ridges(self, p):
        """(n,) mm, what stands out on the back of the head: protuberance and superior nuchal line."""
        op, base, po = self.space.targets["op"], self.marks.base, self.space.targets["po_l"]
        inion = np.array([0.0, op[1] - 10.5, 4.5])
        line = curve([inion, [20, op[1] - 14, 7.0], [41, po[1] + 50, 2.0], [54, po[1] + 28, base + 11]], 20)
        bump = ellipsoid(p, inion + [0, -1.5, 0.5], (12, 9, 9))
        return join(bump, tube(p, line, np.linspace(7.5, 6.0, 20)), 8)


def temporal_bone(p, space: BoneSpace, marks: SkullMarks):
    """(n,) mm, left: the bone round the ear canal, mastoid and styloid process, and the root of the arch."""
    po = space.targets["po_l"]
    block = ellipsoid(p, [po[0] - 10.5, po[1] + 1, po[2] + 3], (11.5, 17, 12))
    mastoid = tube(
        p,
        [
            [po[0] - 4, po[1] + 19, po[2] + 4],
            [po[0] - 4.5, po[1] + 14, po[2] - 13],
            [po[0] - 7.5, po[1] + 9.5, po[2] - 25],
        ],
        [12.5, 9.0, 4.2],
    )
    bone = join(block, mastoid, 6)
    styloid = tube(p, [[po[0] - 13, po[1] - 1, po[2] - 14], [po[0] - 16.5, po[1] - 6.5, po[2] - 29]], [4.2, 2.6])
    return join(bone, styloid, 3)


def joint(bone, p, space: BoneSpace, marks: SkullMarks):
    """``bone`` with the articular eminence, its fossa behind it, and the ear canal."""
    po, c = space.targets["po_l"], marks.condyle
    eminence = tube(p, [c + [-9, -11.5, 3.5], c + [6, -12.0, 4.2], c + [11.5, -10, 5.5]], [4.2, 4.4, 3.6])
    bone = join(bone, eminence, 5)
    fossa = ellipsoid(p, c + [0, 0.6, -1.0], (12.5, 7.2, 8.6))
    bone = carve(bone, fossa, 3.0)
    canal = tube(p, [po + [6, 1.0, -5.0], po + [-11, 1.5, -4.0]], [3.6, 3.0])
    return carve(bone, canal, 1.5)


def base_middle(p, space: BoneSpace, marks: SkullMarks):
    """(n,) mm, sphenoid, pterygoid plates, occipital condyle."""
    y, b = space.targets["po_l"][1], marks.base
    body = ellipsoid(p, [0, y - 30, b + 14], (21, 24, 19))
    basilar = tube(p, [[0, y - 26, b + 6], [0, y - 2, b - 1]], [12, 9.5], ((0, 0, 1), 1.5))
    bone = join(body, basilar, 8)
    lateral = _blade(p, [18.5, y - 30.5, b + 4], [21.0, y - 27.0, b - 8], 6.5, 3.0)
    medial = _blade(p, [13.5, y - 30.5, b + 4], [12.5, y - 28.5, b - 9], 4.6, 2.9)
    root = tube(p, [[16, y - 34, b + 8], [16, y - 35, b - 10]], [6.0, 4.0])
    bone = join(bone, join(join(lateral, medial, 3), root, 4), 4)
    return join(bone, ellipsoid(p, [14.0, y + 5, b - 3.5], (5.5, 10.5, 5.5), None), 4)


def foramen(bone, p, space: BoneSpace, marks: SkullMarks):
    """``bone`` with the foramen magnum carved out of it."""
    y, b = space.targets["po_l"][1], marks.base
    return carve(bone, ellipsoid(p, [0, y + 19, b - 3], (14.5, 17.5, 15)), 3)


def _blade(p, top, bottom, half, thick):
    """A thin plate along y between two points, ``half`` mm to each side in y."""
    path = np.array([np.asarray(top, float), np.asarray(bottom, float)])
    squeezed, along = p / [1, half / thick, 1], path / [1, half / thick, 1]
    return tube(squeezed, along, [thick, thick])


def _smooth(t):
    t = np.clip(t, 0, 1)
    return t * t * (3 - 2 * t)
