# SPDX-License-Identifier: GPL-3.0-or-later
"""The lower jaw: body, chin, ramus with coronoid and condylar process, alveolar ridge; and its hinge."""

import numpy as np

from ...sim.anatomy.head import Jaw
from ...sim.mesh import Mesh
from .skull_depth import CLEARANCE, BoneSpace
from .skull_field import carve, curve, ellipsoid, join, meet, plate, tube, turned
from .skull_nets import surface_nets

#: Corners of the lower dental arch as seen from above: mm lateral of the midline, mm behind the incisors.
ARCH = np.array([(0, 0), (6, 1.2), (13, 6), (18, 13.5), (21.5, 22), (24.5, 31.5), (27.5, 42), (29, 49)], float)


def mandible_field(space: BoneSpace):
    """The mandible as a signed distance field: a function of points (n, 3) mm -> (n,) mm (see `skull_field`)."""
    at = space.targets
    condyle = condyle_centre(space)
    go, gn, pg, sl, infradentale = at["go_l"], at["gn"], at["pg"], at["sl"], at["id"]
    arch = np.column_stack([ARCH[:, 0], infradentale[1] + 4.0 + ARCH[:, 1]])
    ground = np.minimum(space.mouth_limit(arch, -1) - CLEARANCE - 3.6, infradentale[2] - 3.0)
    back = arch[-1]

    # Ramus: a sheet between its rear and front borders, its upper edge dipping to the mandibular notch.
    neck = condyle + [-0.5, 0.5, -5]
    rear = curve([neck, neck * 0.45 + go * 0.55 + [-0.5, -1.0, 0], go + [-1.0, -4.5, 5.0]], 24)
    coronoid = np.array([condyle[0] - 4.0, condyle[1] - 31.0, condyle[2] + 1.0])
    front = curve(
        [
            coronoid,
            coronoid + [-0.8, 0.5, -16],
            coronoid + [-4.0, -4.5, -32],
            np.array([back[0] + 8.5, back[1] - 3.0, go[2] - 4.0]),
        ],
        24,
    )
    across, down = np.meshgrid(np.linspace(0, 1, 30), np.linspace(0, 1, 24))
    notch = 0.30 * np.sin(np.pi * np.clip(across, 0, 1)) ** 1.2
    row = np.clip(notch + (1 - notch) * down, 0, 1) * 23
    ramus = _lerp(_along(rear, row), _along(front, row), across)
    ramus_thick = 3.0 + 1.3 * across**2 + 1.0 * down

    # Body: a ruled sheet from the lower border to the alveolar ridge.
    low = curve(
        [
            go + [-1.5, -8.0, 1.5],
            [0.5 * (go[0] + back[0]) + 4.5, 0.62 * go[1] + 0.38 * gn[1], 0.70 * go[2] + 0.30 * gn[2]],
            [back[0] + 1.0, 0.28 * go[1] + 0.72 * gn[1], 0.40 * go[2] + 0.60 * gn[2]],
            [17.5, gn[1] + 4.5, 0.14 * go[2] + 0.86 * gn[2]],
            [7.5, gn[1] - 1.0, gn[2] + 5.0],
            [0.0, gn[1] - 1.0, gn[2] + 5.5],
        ],
        60,
    )
    high = curve(
        [
            [back[0] + 7.0, back[1] + 3.0, max(ground[7], infradentale[2]) + 4.0],
            [back[0] + 2.5, back[1] - 3.0, 0.5 * ground[7] + 0.5 * max(ground[7], infradentale[2]) + 2.0],
            *np.column_stack([arch, ground])[[6, 5, 4, 3, 2, 1, 0]],
        ],
        60,
    )
    rise = np.linspace(0, 1, 20)[:, None, None]
    body = low[None] + rise * (high - low)[None]
    bulge = 4 * rise * (1 - rise)
    body = body + bulge * np.array([0.0, 1.6, 0.0]) * np.linspace(0, 1, 60)[None, :, None] ** 4
    body_thick = (5.2 - 0.9 * rise + 0.4 * bulge)[..., 0] * np.ones((20, 60))

    sheet = np.concatenate([ramus.reshape(-1, 3), body.reshape(-1, 3)])
    thick = np.concatenate([ramus_thick.ravel(), body_thick.ravel()])
    axis = turned([0.25, 1.0, 0.0])
    sheets = plate(sheet, thick)

    def field(points):
        p = points * [1, 1, 1]
        p[:, 0] = np.abs(p[:, 0])
        bone = sheets(p)
        head = ellipsoid(p, condyle, (9.5, 4.6, 5.0), axis)
        bone = join(bone, join(head, tube(p, [condyle + [-1, 0, -2], neck + [-1.5, -1, -7]], [5.2, 3.6]), 3), 4)
        bone = join(
            bone, tube(p, [coronoid + [0, 0, 1.5], coronoid + [-0.5, 1.0, -9]], [2.4, 4.0], ((1, 0, 0), 1.2)), 4
        )
        chin = ellipsoid(p, pg + [0, 7.0, -2.0], (9.0, 8.0, 9.5))
        chin = join(chin, ellipsoid(p, [10.5, pg[1] + 9.5, gn[2] + 6.0], (6.0, 5.5, 5.0)), 6)
        bone = join(bone, chin, 6)
        # The hollow above the chin.
        bone = carve(bone, ellipsoid(p, sl + [0, -5.5, 1.5], (15, 6, 5.5)), 5)
        # The angle, thickened and a little turned out where the masseter holds.
        bone = join(bone, ellipsoid(p, go + [-3.0, -8.0, 7.0], (4.2, 9, 10), turned([0.25, 1, 0.3])), 6)
        near = np.flatnonzero(bone < 12)
        bone[near] = meet(bone[near], space.too_shallow(p[near]), 3)
        return bone

    return field


def condyle_centre(space: BoneSpace) -> np.ndarray:
    """(3,) mm, the middle of the left condyle: before and below the porion."""
    return space.targets["po_l"] + [-8.5, -12.5, -7.0]


def make_mandible(skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray]) -> Mesh:
    """The mandible as one closed symmetric mesh of quads under ``skin``, its landmarks at their tissue depths."""
    space = BoneSpace(skin, groups, landmarks)
    low, high = mandible_box(space)
    mesh = surface_nets(mandible_field(space), low, high, cell=4.2)
    return space.kept_inside(space.snapped(mesh, ("pg", "sl", "go_l", "go_r"), reach=12.0))


def make_jaw(skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray]) -> Jaw:
    """The hinge through the condyles; the incisor point is a guess until the teeth stand."""
    space = BoneSpace(skin, groups, landmarks)
    left = condyle_centre(space)
    incisor = space.targets["id"] * [0, 1, 1] + [0, 1.5, 9.5]
    return Jaw(left, left * [-1, 1, 1], incisor)


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
