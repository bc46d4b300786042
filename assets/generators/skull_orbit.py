# SPDX-License-Identifier: GPL-3.0-or-later
"""The openings of the facial skull: the orbits, deep four-sided cones under a sharp rim, and the nasal aperture."""

import numpy as np

from ...sim.angles import bearing
from .skull_field import carve, curve, ellipsoid, join, meet, plate, tube
from .skull_marks import SkullMarks

#: Fat between the lids' lining and the walls of the orbit, mm.
FAT = 2.4
#: Thickness of the walls behind the rim, mm.
WALL = 6.5
#: Thickness of the nasal bones, mm.
ROOF = 4.0


class Orbit:
    """The left orbit as two fields: its hollow, and the rim that stands round the opening."""

    def __init__(self, marks: SkullMarks):
        self.apex, rim = marks.apex, marks.rim
        low, high = marks.cups
        middle = np.array([(low[0] + high[0]) / 2, high[1] - (high[2] - low[2]) / 2, (low[2] + high[2]) / 2])
        self.globe = middle, (high - low)[[0, 2, 2]] / 2 + FAT
        self.level = rim[:, 1].mean()
        # The rim's outline as seen from the apex, in polar coordinates.
        flat = self._seen(rim)
        self.middle = (flat.min(axis=0) + flat.max(axis=0)) / 2
        off = flat - self.middle
        turn = bearing(off[:, 1], off[:, 0])
        order = np.argsort(turn)
        turn, radius = turn[order], np.linalg.norm(off, axis=1)[order]
        self._turn = np.concatenate([turn - 2 * np.pi, turn, turn + 2 * np.pi])
        self._radius = np.tile(radius, 3)
        # Thick at the brow, thin at the nose and below.
        high = np.clip((rim[:, 2] - rim[:, 2].min()) / np.ptp(rim[:, 2]), 0, 1)
        side = np.clip((rim[:, 0] - rim[:, 0].min()) / np.ptp(rim[:, 0]), 0, 1)
        thick = 2.0 + 1.7 * high**2 + 1.2 * side**2
        centre = rim - np.array([self.middle[0], 0, self.middle[1]])
        away = np.stack([centre[:, 0], 0 * high, centre[:, 2]], axis=1)
        away /= np.linalg.norm(away, axis=1, keepdims=True)
        self.rim = plate(rim + away * thick[:, None] * 0.8 + [0, 0.9, 0] * thick[:, None], thick)

    def _taper(self, y):
        """Width of the cone at a depth against its width at the rim: widest a little behind the rim."""
        deep = np.clip((y - self.level) / (self.apex[1] - self.level), 0, 0.99)
        return 1 - deep**1.45

    def _seen(self, p):
        scale = np.maximum(self._taper(p[:, 1]), 0.05)[:, None]
        axis = self.apex[[0, 2]]
        return axis + (p[:, [0, 2]] - axis) / scale

    def hollow(self, p):
        """(n,) mm, negative within the orbit (and in front of it)."""
        off = self._seen(p) - self.middle
        radius = np.interp(bearing(off[:, 1], off[:, 0]), self._turn, self._radius)
        cone = (np.linalg.norm(off, axis=1) - radius) * np.maximum(self._taper(p[:, 1]), 0.05)
        cone = meet(cone, p[:, 1] - self.apex[1] + 3.0, 5)
        return join(cone, ellipsoid(p, *self.globe), 4)


class Nose:
    """Nasal bones, the pear-shaped aperture with its spine, and the cavity behind."""

    #: Outline of the aperture: share of the way down, half width mm.
    PEAR = np.array([(-0.3, 2.0), (0.0, 3.4), (0.2, 4.6), (0.4, 6.8), (0.6, 9.6), (0.8, 11.6), (0.93, 11.4), (1.3, 9)])

    def __init__(self, space, marks: SkullMarks):
        at, self.marks, self.space = space.targets, marks, space
        n, rhi, ans = at["n"], at["rhi"], at["ans"]
        self.top, self.ans, self.floor = rhi[2], ans, marks.floor
        rim = marks.rim
        side = rim[np.r_[88:96, 0:6]].mean(axis=0)
        # Across: from the bridge down to the medial rim of the orbit; down: from the nasion to the aperture.
        top, mid = n[2] + 8, rhi[2] + 5
        rows = [
            [(0, top), (6, top - 2), (12, top - 5)],
            [(0, n[2]), (5, n[2] - 1), (side[0] - 1.0, n[2] - 4)],
            [(0, n[2] - 9), (5, n[2] - 11), (side[0] - 1.0, n[2] - 14)],
            [(0, mid + 3), (5.5, mid), (14.5, mid - 2)],
            [(0, rhi[2] + 1), (5.8, rhi[2] - 3), (15, rhi[2] - 5)],
        ]
        grid = np.array([curve(np.array(row, float), 16) for row in rows])
        grid = np.stack([curve(grid[:, k], 24) for k in range(16)], axis=1).reshape(-1, 2)
        thick = np.tile(np.linspace(2.5, 2.9, 16), 24)
        self.roof = plate(self._under(grid, thick), thick)
        # The edge of the aperture, seen from the side: from the tip of the nasal bones back and down to the floor.
        back = min(float(space.before(np.array([[15.5, rhi[2] - 14.0]]), 2.0)[0]), ans[1] + 6.0)
        low = np.array([(1.6, -1.5), (0.0, 0.0), (-2.0, 0.2), (-4.5, 0.42), (-8.0, 0.66), (-12.0, 0.88), (-16.0, 1.0)])
        self.edge = (rhi[2] + low[::-1, 0], rhi[1] + low[::-1, 1] * (back - rhi[1]))
        # The ridge of the nose, which the cavity follows at the thickness of its bones.
        self.ridge, self.slope = rhi, (n[2] - rhi[2]) / max(n[1] - rhi[1], 4.0)

    def _under(self, xz, thick):
        """(k, 3) points so deep under the skin that a plate of half thickness ``thick`` (k,) just fits, evened out."""
        return np.stack([xz[:, 0], self.space.before(xz, thick + 0.2), xz[:, 1]], axis=1)

    def hole(self, p):
        """(n,) mm, negative in the aperture and in the cavity behind it."""
        down = (p[:, 2] - self.top) / (self.floor - self.top)
        wide = np.interp(down, *self.PEAR.T) + np.clip((p[:, 1] - self.ans[1] - 6) * 0.25, 0, 2.0)
        under = self.ridge[2] + self.slope * (p[:, 1] - self.ridge[1]) - p[:, 2]
        roof = np.maximum(ROOF - under / np.hypot(1, self.slope), p[:, 2] - self.top - 6)
        pear = meet(p[:, 0] - wide, np.maximum(self.floor - p[:, 2], roof), 5.0)
        return meet(pear, p[:, 1] - (self.ans[1] + 18), 5)

    def cleared(self, bone, p):
        """``bone`` (n,) with the aperture carved again, and what stands in it."""
        return join(carve(bone, self.hole(p), 2.2), self.within(p), 2.0)

    def bones(self, p):
        """(n,) mm, the bones round the aperture."""
        # A wedge whose sides the skin's depth trims: nasal bones and the frontal processes of the maxilla.
        wedge = meet(np.interp(p[:, 2], *self.edge) - p[:, 1], p[:, 0] - 15.5, 3)
        wedge = meet(wedge, np.maximum(p[:, 2] - self.ridge[2] - 22, self.floor + 1 - p[:, 2]), 3)
        bone = join(self.roof(p), meet(wedge, p[:, 1] - self.ans[1] - 12, 3), 2.5)
        # Between the orbits: the ethmoid, without its cells.
        top, bridge = self.marks.rim[:, 2].max(), self.space.targets["n"]
        slope = np.interp(
            p[:, 2], [self.top - 2, self.top + 4, bridge[2]], [bridge[1] + 14, bridge[1] + 4, bridge[1] + 3]
        )
        core = np.maximum(np.maximum(p[:, 0] - 12, slope - p[:, 1]), np.maximum(p[:, 2] - top, self.top + 3 - p[:, 2]))
        core = meet(core, p[:, 1] - self.marks.apex[1], 3)
        return join(bone, core, 3)

    def within(self, p):
        """(n,) mm, what stands in the opening: the spine at its foot and the septum behind."""
        a, f = self.ans, self.floor
        spine = tube(p, [[0, a[1] + 12, f - 3.0], [0, a[1] + 5, f - 1.6], [0, a[1] + 1.8, a[2] + 0.2]], [3.2, 2.8, 1.7])
        septum = np.abs(p[:, 0]) - 1.7
        septum = meet(septum, (a[1] + 11 + 0.35 * np.abs(p[:, 2] - (self.top + f) / 2)) - p[:, 1], 1)
        septum = meet(
            septum, np.maximum(p[:, 1] - (a[1] + 28), np.maximum(f - 4 - p[:, 2], p[:, 2] - self.top - 10)), 1
        )
        return join(spine, septum, 3)


def opened(bone, p, orbit: Orbit, nose: Nose):
    """``bone`` (n,) with rims and nasal bones added, and the openings carved out of it."""
    hollow = orbit.hollow(p)
    behind = p[:, 1] - (orbit.level - 4)
    bone = join(bone, meet(hollow - WALL, 6 - behind, 4), 3)  # thin walls of its own behind the rim
    bone = join(bone, orbit.rim(p), 3.0)
    bone = join(bone, nose.bones(p), 3.0)
    bone = carve(bone, nose.hole(p), 2.2)
    bone = carve(bone, hollow, 2.4)
    return join(bone, nose.within(p), 2.0)
