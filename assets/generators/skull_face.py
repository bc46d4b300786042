# SPDX-License-Identifier: GPL-3.0-or-later
"""The facial skull: maxilla with its alveolar process and palate, cheekbone and zygomatic arch."""

import numpy as np
from scipy.ndimage import gaussian_filter, maximum_filter

from .skull_arch import DentalArch
from .skull_depth import BoneSpace
from .skull_field import carve, curve, ellipsoid, join, meet, plate, tube
from .skull_marks import SkullMarks

#: Half the thickness of the hard palate, mm.
PALATE = 2.9


class Maxilla:
    """The upper jaw of the left half as a field."""

    def __init__(self, space: BoneSpace, marks: SkullMarks, arch: DentalArch):
        self.marks, self.arch = marks, arch
        at, orb = space.targets, space.targets["or_l"]
        self.at = at
        self.orb, self.ans = orb, at["ans"]
        ans = self.ans
        # The front of the body: from the rim of the orbit and the aperture down to the roots of the teeth.
        tops = np.array([(15.0, ans[2] + 11), (20, orb[2] - 6), (29.7, orb[2] - 4), (38, orb[2] - 3), (45, orb[2] - 6)])
        sunk = np.array([3.2, 3.6, 3.2, 3.2, 3.2])
        tops = np.stack([tops[:, 0], space.before(tops, sunk), tops[:, 1]], axis=1)
        middles = np.array([[14.5, ans[1] + 6.2, ans[2] + 4], [20.5, ans[1] + 10.4, ans[2] + 7],
                            [27.5, ans[1] + 17.0, ans[2] + 8.5], [33, ans[1] + 23, ans[2] + 10],
                            [39.0, ans[1] + 29, ans[2] + 9]]) + [0, 3.0, 0]  # fmt: skip
        low = arch.along(np.array([12.0, 20.0, 28.0, 37.0, 46.0]), out=1.2, up=9.0) + [0, 3.0, 0]
        grid = np.array([curve(row, 24) for row in (tops, middles, low)])
        grid = np.stack([curve(grid[:, k], 20) for k in range(24)], axis=1)
        self.front = plate(grid.reshape(-1, 3), np.full(20 * 24, 3.2))
        # The hard palate lies on the roof of the mouth.
        across, back = np.meshgrid(np.linspace(0, 18, 10), np.linspace(ans[1] + 6, ans[1] + 45, 16), indexing="ij")
        high = space.mouth_limit(np.stack([across, back], axis=-1).reshape(-1, 2), 1, 2.5).reshape(across.shape)
        high = gaussian_filter(maximum_filter(high, 3), 1.0, mode="nearest") + PALATE + 1.2
        spots = np.stack([across, back, np.maximum(high, ans[2] - 6.0)], axis=-1).reshape(-1, 3)
        self.roof = plate(np.concatenate([spots, spots * [-1, 1, 1]]), np.full(2 * len(spots), PALATE))

    def body(self, p):
        """(n,) mm, body, alveolar process and palate."""
        orb, ans = self.orb, self.ans
        deep = ellipsoid(p, [25, ans[1] + 32, (orb[2] + ans[2]) / 2 + 1], (14.5, 22, 18))
        deep = join(deep, ellipsoid(p, [26.5, ans[1] + 43, ans[2] + 1.5], (8.0, 10.5, 15)), 8)
        bone = join(deep, self.front(p), 4)
        bone = join(bone, self.arch.ridge(p, height=15.0), 5)
        return join(bone, self.palate(p), 4)

    def palate(self, p):
        """(n,) mm, the hard palate under the floor of the nose."""
        slab = meet(self.roof(p), self.arch.off(p[:, :2]), 3)  # within the arch
        return meet(slab, p[:, 1] - (self.ans[1] + 46 - 0.01 * p[:, 0] ** 2), 3)


class Cheekbone:
    """The left zygomatic bone with its processes, and the arch to the temporal bone, as a field."""

    def __init__(self, space: BoneSpace, marks: SkullMarks, arch: DentalArch):
        at, rim, malar = space.targets, marks.rim, marks.malar
        orb, zy, po = at["or_l"], at["zy_l"], at["po_l"]
        side = rim[np.argmax(rim[:, 0])]
        # Body: a bent plate from the rim to the lower border.
        top = [orb + [1, 3.5, -3], [rim[:, 0].max() - 7, side[1] + 0.5, orb[2] + 2], side + [3.2, 3.5, -7],
               side + [3.0, 9.5, -8]]  # fmt: skip
        low = [
            [33, orb[1] + 10, orb[2] - 18],
            malar + [-8.5, 0.5, -8.0],
            malar + [1.5, 2.5, -8.5],
            malar + [5.0, 12, -4.5],
        ]
        grid = np.linspace(0, 1, 12)[:, None, None]
        sheet = curve(top, 20) * (1 - grid) + curve(low, 20) * grid
        bulge = 4 * grid * (1 - grid) * np.array([0.9, -1.6, 0.0])
        self.body = plate((sheet + bulge).reshape(-1, 3), np.full(240, 4.0))
        above = rim[np.argmax(rim[:, 2] + rim[:, 0])] + [4.0, 4.2, 5]
        self.frontal = [side + [3.0, 4.0, -8], side + [3.0, 3.6, 2], above]
        # The arch, as near to the skin as its depth allows.
        back = malar[1] + 9
        yz = np.array([(back, malar[2] + 0.5), (0.6 * back + 0.4 * zy[1], malar[2] + 4.0), (zy[1] - 5, zy[2] + 0.2),
                       (zy[1] + 6, zy[2] + 1.5), (po[1] - 13, po[2] + 4.5), (po[1], po[2] + 7.5)])  # fmt: skip
        self.bar = curve(space.beside(yz, [2.6, 2.2, 2.2, 2.2, 2.6, 4.5]), 30)
        self.root = [self.bar[23], marks.condyle + [2, -9.5, 7.5]]
        # The strut down to the first molar.
        foot, start = arch.along(np.array([40.0]), out=3.0, up=13.0)[0], malar + [-6, 4.5, -5]
        self.strut = [start, start * 0.45 + foot * 0.55 + [1.0, 1.0, 2.5], foot]

    def __call__(self, p):
        """(n,) mm."""
        bone = join(self.body(p), tube(p, self.frontal, [5.2, 4.2, 5.6], ((0.35, 0.94, 0), 1.25)), 4)
        thick = np.interp(np.arange(30), [0, 7, 15, 22, 29], [7.0, 5.8, 5.4, 5.4, 6.4])
        bone = join(bone, tube(p, self.bar[::2], thick[::2], ((1, 0, 0), 1.7)), 5)
        bone = join(bone, tube(p, self.root, [4.4, 5.0]), 5)
        return join(bone, tube(p, self.strut, [7.0, 5.6, 4.5]), 6)


def canine_fossa(bone, p, space: BoneSpace, marks: SkullMarks):
    """``bone`` with the hollow below the rim of the orbit, beside the nose."""
    orb, ans = space.targets["or_l"], space.targets["ans"]
    return carve(bone, ellipsoid(p, [orb[0] - 4.5, ans[1] + 3.0, ans[2] + 11.5], (9, 8.0, 9)), 8)
