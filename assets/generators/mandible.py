# SPDX-License-Identifier: GPL-3.0-or-later
"""The lower jaw: body and chin, alveolar ridge, ramus with coronoid and condylar process; and its hinge."""

from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from ...sim.anatomy.head import Jaw
from ...sim.mesh import Mesh
from ...sim.tissue.jaw import opening_mm
from .skull_arch import DentalArch
from .skull_depth import BoneSpace
from .skull_field import carve, curve, ellipsoid, join, meet, plate, tube, turned
from .skull_marks import condyle_centre
from .skull_mesh import bone_mesh
from .teeth_places import ToothPlace, tooth_places

#: How far the incisors go to the wide open mouth, mm (Travers et al. 2000: mean of 27 women; condyles go 11.9).
OPENING = 46.6


class Mandible:
    """The left half of the mandible as a signed distance field: call it with points (n, 3) mm -> (n,) mm."""

    def __init__(self, space: BoneSpace, arch: DentalArch):
        self.space, self.arch = space, arch
        at = space.targets
        self.go, self.gn, self.pg, self.sl = (at[k] for k in ("go_l", "gn", "pg", "sl"))
        self.condyle = condyle_centre(space)
        self.coronoid = self.condyle + [-3.5, -32.0, 0.5]
        self.end = np.append(arch.middle[-1], arch.crest[-1])
        self.ramus, self.body, self.shelf = (
            plate(p.reshape(-1, 3), np.broadcast_to(t, p.shape[:2]).ravel()) for p, t in self._sheets()
        )

    def _sheets(self):
        """Points in the middle of ramus and body, and half the thickness there."""
        go, gn, c, end = self.go, self.gn, self.condyle, self.end
        # Ramus: between its rear and its front border, the upper edge dipping to the mandibular notch.
        neck = c + [-1.0, 0.5, -5]
        rear = curve([neck, neck * 0.62 + go * 0.38 + [-0.5, -2.0, 0], neck * 0.25 + go * 0.75 + [-1.5, -3.2, 0],
                      go + [-3.0, -5.6, 3.0]], 24)  # fmt: skip
        front = curve([self.coronoid, self.coronoid + [-0.4, 2.4, -10], self.coronoid + [-2.5, 1.5, -24],
                       [self.coronoid[0] - 5.0, self.coronoid[1] - 0.5, end[2] + 6],
                       [self.coronoid[0] - 7.0, self.coronoid[1] - 1.5, end[2] - 7]], 24)  # fmt: skip
        across, down = np.meshgrid(np.linspace(0, 1, 30), np.linspace(0, 1, 24))
        notch = 0.28 * np.sin(np.pi * across**0.9) ** 1.3
        row = np.clip(notch + (1 - notch) * down, 0, 1) * 23
        ramus = _lerp(_along(rear, row), _along(front, row), across)
        ramus_thick = 2.7 + 0.9 * across**3 + 1.3 * down**2 + 0.8 * (1 - across) ** 6
        # Body: from the lower border to below the roots.
        self.low = low = curve(
            [
                go + [-4.0, -8.5, -2.5],
                [0.62 * go[0] + 12.0, 0.74 * go[1] + 0.26 * gn[1], 0.76 * go[2] + 0.24 * gn[2]],
                [0.30 * go[0] + 21.0, 0.47 * go[1] + 0.53 * gn[1], 0.58 * go[2] + 0.42 * gn[2]],
                [25.0, 0.20 * go[1] + 0.80 * gn[1], 0.32 * go[2] + 0.68 * gn[2]],
                [15.5, gn[1] + 1.5, 0.08 * go[2] + 0.92 * gn[2] + 4.5],
                [7.0, gn[1] - 2.5, gn[2] + 5.0],
                [0.0, gn[1] - 3.0, gn[2] + 5.5],
            ],
            60,
        )
        arch = self.arch
        length = arch.length[-1]
        # A little outside the roots behind, where the ridge leaves the body to the tongue's side.
        top = arch.along(np.linspace(length, 0, 52), out=0.0, up=8.0)
        inner = (
            arch.along(np.linspace(length, 0, 52), out=0.0, up=8.0)[:, :2]
            - arch.middle[np.searchsorted(arch.length, np.linspace(length, 0, 52)).clip(0, len(arch.length) - 1)]
        )
        top[:, :2] -= inner * np.linspace(0.0, 1.0, 52)[:, None]
        back = curve([[self.coronoid[0] - 5.0, self.coronoid[1] + 3, end[2] - 6], top[0] + [1.0, 0.5, 0]], 9)[:8]
        high = np.concatenate([back, top])
        rise = np.linspace(0, 1, 20)[:, None, None]
        body = low[None] + rise * (high - low)[None]
        share = np.linspace(0, 1, 60)
        thick = 5.4 - 0.6 * rise[..., 0] + 0.5 * share**4 + 0.6 * np.exp(-(((share - 0.45) / 0.3) ** 2))
        thick = thick - 1.4 * np.exp(-((share / 0.12) ** 2))
        # The shelf between the molars and the front border of the ramus, and the trigone behind them.
        inside = arch.along(np.linspace(length - 22, length, 30), out=-0.5, up=6.5)
        outside = curve([arch.along(np.array([length - 24]), out=1.0, up=8.0)[0],
                         [self.coronoid[0] - 8.0, self.coronoid[1] - 5.0, end[2] - 11],
                         [self.coronoid[0] - 5.5, self.coronoid[1] + 4.0, end[2] - 3],
                         [self.coronoid[0] - 4.5, self.coronoid[1] + 9.0, end[2] - 2]], 30)  # fmt: skip
        inside[-8:] += np.linspace(0, 1, 8)[:, None] * np.array([2.0, 3.0, 0.5])
        shelf = inside[None] + np.linspace(0, 1, 12)[:, None, None] * (outside - inside)[None]
        return (ramus, ramus_thick), (body, thick), (shelf, np.full((12, 30), 4.0))

    def upper(self, p):
        """(n,) mm, ramus and its processes alone: what moves in the joint."""
        c = self.condyle
        bone = self.ramus(p)
        head = ellipsoid(p, c + [-0.5, 0, 0.5], (9.6, 4.4, 4.8), turned([0.28, 1.0, 0.0]))
        bone = join(bone, join(head, tube(p, [c + [-0.5, 0, -2], c + [-2.0, 0.2, -11]], [5.4, 3.6]), 3), 4)
        tip = tube(p, [self.coronoid + [0, 1.0, 1.0], self.coronoid + [-0.3, 3.0, -10]], [1.9, 4.2], ((1, 0, 0), 1.25))
        return join(bone, tip, 4)

    def __call__(self, points):
        p = np.array(points)
        p[:, 0] = np.abs(p[:, 0])
        go, gn, pg, sl = self.go, self.gn, self.pg, self.sl
        bone = join(join(self.body(p), self.shelf(p), 6), self.upper(p), 9)
        # Oblique line: from the front border of the ramus forward over the body.
        a = self.coronoid + [-3.0, 1.5, -27]
        line = curve([a, [a[0] - 2.5, a[1] - 5, self.end[2] - 10], [a[0] - 9.0, a[1] - 19, self.end[2] - 18]], 16)
        bone = join(bone, tube(p, line, np.linspace(4.0, 3.0, 16)), 6)
        # Mental protuberance: a triangle with a tubercle at either foot.
        chin = tube(p, [sl + [0, 6.5, -4], pg + [0, 6.8, -1]], [4.0, 6.8])
        chin = join(chin, ellipsoid(p, [9.5, pg[1] + 7.5, gn[2] + 5.0], (6.5, 5.5, 4.6)), 7)
        bone = join(bone, chin, 6)
        bone = carve(bone, ellipsoid(p, [15.5, pg[1] - 2.0, sl[2] - 4.5], (8.5, 6.5, 5.0)), 7)
        # The angle, turned out a little where the masseter holds.
        bone = join(bone, ellipsoid(p, go + [-4.0, -10.0, 8.0], (4.0, 10, 11), turned([0.25, 1, 0.3])), 6)
        # Genial tubercles.
        bone = join(bone, ellipsoid(p, [0, gn[1] + 4.5, gn[2] + 12.5], (3.0, 3.6, 3.0)), 4)
        near = np.flatnonzero(bone < 12)
        bone[near] = meet(bone[near], self.space.too_shallow(p[near]), 3)
        return self.arch.on(bone, p, 9.5)


def make_mandible(skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray]) -> Mesh:
    """The mandible as one closed symmetric mesh of quads under ``skin``, its landmarks at their tissue depths."""
    space = BoneSpace(skin, groups, landmarks)
    arch = DentalArch(space, tooth_places(skin, groups, landmarks)["lower"], -1)
    field = Mandible(space, arch)
    low, high = mandible_box(space)
    mesh = bone_mesh(field, low, high, 4.0, arch)
    return space.kept_inside(space.snapped(mesh, ("pg", "sl", "go_l", "go_r"), reach=12.0))


def make_jaw(skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray]) -> Jaw:
    """The hinge through the condyles, opening `OPENING` between the incisors."""
    space = BoneSpace(skin, groups, landmarks)
    return jaw_of(space, tooth_places(skin, groups, landmarks)["lower"][0])


def jaw_of(space: BoneSpace, incisor: ToothPlace) -> Jaw:
    """The `Jaw` given the place of the lower middle incisor."""
    left = condyle_centre(space)
    edge = (incisor.neck + incisor.axes[2] * incisor.tooth.crown) * [0, 1, 1]
    jaw = Jaw(left, left * [-1, 1, 1], edge)
    return replace(jaw, open_max=brentq(lambda turn: opening_mm(replace(jaw, open_max=turn), 1.0) - OPENING, 0.2, 1.0))


def mandible_box(space: BoneSpace):
    """Lowest and highest corner (3,) mm of a box around the mandible."""
    at = space.targets
    low = [-75, at["pg"][1] - 12, at["gn"][2] - 10]
    return low, [75, at["go_l"][1] + 25, at["po_l"][2] + 15]


def _along(line, row):
    i = np.minimum(row.astype(int), len(line) - 2)
    t = (row - i)[..., None]
    return line[i] * (1 - t) + line[i + 1] * t


def _lerp(a, b, t):
    return a + (b - a) * t[..., None]
