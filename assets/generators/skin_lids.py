# SPDX-License-Identifier: GPL-3.0-or-later
"""Lids: their margins placed on a head, then finished so that they lie on the eyeball."""

import numpy as np

from ...sim.adapt.lid_contact import BACK, LidContact
from ...sim.anatomy.eyeball import reach
from ...sim.angles import bearing
from ...sim.mesh import Mesh
from ...sim.mesh_subdivision import limit
from .eye_frame import BALL, GAP, RADIUS, eye_frames
from .skin_curves import even, lerp, unit
from .skin_layout import Layout

#: Lid margins (x, z) from the inner to the outer corner, mm.
UPPER_LID = [(17.6, 14.4), (21, 18.3), (25.5, 21.7), (31.5, 23), (37.5, 22.3), (42, 20), (45, 17.2)]

LOWER_LID = [(17.6, 14.4), (21, 13.6), (25.5, 12.2), (31.5, 11.5), (37.5, 12.2), (42, 14.6), (45, 17.2)]

#: Depth y of the margin's inner edge by x, mm.
MARGIN_DEPTH = ([17.6, 21, 25.5, 31.5, 37.5, 42, 45], [-84.6, -86.5, -88.2, -88.7, -87.2, -83.0, -78.0])

#: Height of the averaged lower margin over the eye's centre, mm: it touches the iris.
LOWER_MARGIN = -5.9

#: Half of the distance between the eyes' centres, mm (growth table at 25 years, sexes' mean: 61.6).
HALF_PUPILS = 30.9


def place_lids(layout, x, head):
    ring = layout.rings["eye_l"]
    orbit = x[ring[0]]
    margin = np.zeros((24, 2))
    for k, (low, up) in enumerate(zip(even(LOWER_LID, 13), even(UPPER_LID, 13), strict=True)):
        margin[(2 + k) % 24] = low
        margin[(2 - k) % 24] = up
    inner = np.stack([margin[:, 0], np.interp(margin[:, 0], *MARGIN_DEPTH), margin[:, 1]], axis=1)
    away = unit(margin - margin.mean(axis=0))
    outer = inner + np.stack([0.35 * away[:, 0], np.full(24, -1.6), 0.35 * away[:, 1]], axis=1)
    for k, t in ((1, 0.66), (2, 0.46), (3, 0.32), (4, 0.16)):
        x[ring[k]] = head.front(lerp(margin, orbit[:, [0, 2]], t))
    x[ring[5]], x[ring[6]] = outer, inner
    middle = inner.mean(axis=0)
    for k, (back, size) in ((7, (6.0, 0.9)), (8, (16.0, 0.7))):
        x[ring[k]] = lerp(np.tile(middle, (24, 1)), inner, size) + [0, back, 0]
    patch = layout.patches["eye_l"]
    x[patch[1, 1:-1]] = 0.5 * (x[patch[0, 1:-1]] + x[patch[2, 1:-1]]) + [0, 3, 0]


#: Visible edge of the lids at rest in mm from the eye's centre, (to the side, up): inner corner first. The upper lid
#: covers 1 to 2 mm of the iris, the lower touches it (oculoplastic texts); MRD1 and MRD2 as in Malik et al. 2022.
UPPER_EDGE = [
    (-14.4, -2.3),
    (-12.3, -0.6),
    (-8.8, 2.1),
    (-4.6, 3.85),
    (-0.6, 4.35),
    (4.0, 3.8),
    (8.0, 2.1),
    (12.3, -0.6),
]
LOWER_EDGE = [
    (-14.4, -2.3),
    (-12.0, -3.1),
    (-8.6, -4.2),
    (-3.6, -5.5),
    (1.2, -5.9),
    (6.0, -5.2),
    (9.6, -3.3),
    (12.3, -0.6),
]

#: The lining turns back this far above and below the edges, degrees about the eye.
FORNIX = 21

#: Thickness of the lids at their edge, mm.
THICKNESS = 1.3


def _column(count=24):
    """Steps from the inner corner 0..12, the same from the outer corner, and which columns are the upper lid's."""
    i = np.arange(count)
    inner = np.minimum((i - 2) % count, (2 - i) % count)
    return inner, 12 - inner, (i >= 15) | (i <= 1)


def finish_lids(layout: Layout, x: np.ndarray) -> None:
    """Lids that lie on an eyeball behind the averaged ones: margin, tarsal plate, crease and fold, and the cup behind.

    The profiles are those of the limit surface: the cage goes farther where subdivision will round it off.
    """
    ring = layout.rings["eye_l"]
    centre = _eye_centre(x[ring[6]])
    inner, outer, above = _column()
    goal = {0: x[ring[0]] - centre, 1: x[ring[1]] - centre}
    goal[6], goal[5] = _margins(inner, outer, above)
    goal[4], goal[3], goal[2] = _lid_skin(goal[5], goal[1], inner, outer, above)
    goal[7], goal[8], back = _cup(goal[6], inner, outer, above)
    for k in range(2, 9):
        x[ring[k]] = goal[k] + centre
    patch = layout.patches["eye_l"]
    x[patch[1, 1:-1]] = back + centre
    smooth = limit(layout.faces, layout.count)
    front = ring[2:7].ravel()
    want = np.concatenate([goal[k] for k in range(2, 7)]) + centre
    firm = (
        np.array([0.5, 0.8, 0.8, 0.75, 0.9])[:, None] * np.clip((np.minimum(inner, outer) - 0.4) / 2.6, 0, 1)
    ).reshape(-1, 1)
    rows = smooth[front]
    for _ in range(24):
        x[front] += firm * (want - rows @ x) + 0.08 * (want - x[front])
    contact = _contact(layout, ring[6][(inner >= 3) & (outer >= 1)])
    for _ in range(3):  # the ball goes where the lids are, the lids where the ball is
        x[:] = contact.settled(x, eye_frames(x)[0])


def _contact(layout: Layout, edge) -> LidContact:
    """The left lids as they settle on their ball, margins and backs rather than the seen skin."""
    ring, patch = layout.rings["eye_l"], layout.patches["eye_l"]
    stiff = np.full(layout.count, np.inf)
    for k, hardness in ((4, 16.0), (5, 2.0), (6, BACK), (7, BACK), (8, BACK)):
        stiff[ring[k]] = hardness
    stiff[patch[1, 1:-1]] = BACK
    triangles = Mesh(np.zeros((layout.count, 3)), layout.faces).triangles
    return LidContact(layout.faces, triangles, layout.count, stiff, edge)


def _eye_centre(margin: np.ndarray) -> np.ndarray:
    """Centre (3,) mm of the ball on which the averaged margin (24, 3) lies best."""
    inner, outer, _ = _column()
    height = margin[8, 2] - LOWER_MARGIN
    central = (inner >= 4) & (outer >= 3)
    flat = margin[central][:, [0, 2]] - [HALF_PUPILS, height]
    depth = np.mean(margin[central, 1] + np.sqrt((RADIUS + GAP) ** 2 - (flat**2).sum(axis=1)))
    return np.array([HALF_PUPILS, depth, height])


def _margins(inner, outer, above):
    """Inner and outer edge (24, 3) of the margins about the eye's centre."""
    edge = np.zeros((24, 3))
    for k, (low, up) in enumerate(zip(even(LOWER_EDGE, 13), even(UPPER_EDGE, 13), strict=True)):
        edge[(2 + k) % 24, [0, 2]] = low
        edge[(2 - k) % 24, [0, 2]] = up
    across = np.linalg.norm(edge, axis=1)
    depth = np.full(24, RADIUS)
    for _ in range(8):  # on the globe, and on the cornea where the upper lid covers it
        room = (reach(BALL, np.arctan2(across, depth)) + GAP) ** 2 - across**2
        depth = np.sqrt(np.maximum(room, 1.5))
    # the inner corner leaves the ball and makes room for the caruncle
    lake = np.array([-8.4, -8.2, -7.7])
    edge[:, 1] = np.where(inner < 3, np.append(lake, np.zeros(10))[inner], -depth)
    edge[14, [0, 1]] = 12.1, -2.2
    # the edges face forward, the upper one level, toward the corners more than the ball's own surface does
    turn = np.stack([np.clip(np.minimum(inner, outer) / 4, 0, 1), np.ones(24), np.where(above, 0.35, 0.9)], axis=1)
    forward = unit(edge * turn)
    thick = np.interp(np.minimum(inner, outer), [0, 1, 2, 3], [0.5, 1.1, 1.5, THICKNESS])
    rim = edge + forward * thick[:, None]
    rim[2] = edge[2] + [-1.2, -0.5, 0]
    rim[14] = edge[14] + [1.2, 0.1, 0]
    return edge, rim


def _lid_skin(rim, orbit, inner, outer, above):
    """Tarsal plate, crease and fold of the upper lid; plate, roll and groove of the lower one: (24, 3) each."""
    start = bearing(rim[:, 2], -rim[:, 1])
    apart = np.hypot(rim[:, 1], rim[:, 2])

    def over(length, height, share):
        """``length`` mm from the edge and ``height`` mm over the ball, going ``share`` of the way to the orbit sideways."""
        side = lerp(rim[:, 0], orbit[:, 0], share)
        angle = start + np.where(above, 1, -1) * length / (RADIUS + 2)
        depth = np.sqrt(np.maximum((RADIUS + height) ** 2 - side**2, 4))
        stand = apart + height - THICKNESS - np.clip(1.6 * (inner - 9), 0, 3.2)
        depth = np.maximum(depth, stand)  # the corners leave the ball
        return np.stack([side, -depth * np.cos(angle), depth * np.sin(angle)], axis=1)

    def table(up, low):
        knots = [0, 1, 2, 4, 6, 8, 10, 11, 12]
        return np.where(above, np.interp(inner, knots, up), np.interp(inner, knots, low))

    plate = over(table([1] * 9, [1] * 9), np.full(24, 2.0), np.full(24, 0.06))
    crease = over(
        table([1.6, 2.2, 2.7, 3.4, 3.7, 3.6, 2.9, 2.2, 1.6], [2.5, 2.8, 3.4, 4.0, 4.3, 4.3, 3.9, 3.3, 2.5]),
        table([2.4] * 9, [2.7] * 9),
        np.full(24, 0.22),
    )
    fold = over(
        table([2, 2.3, 2.6, 2.9, 3.0, 3.1, 3.4, 3.5, 3.2], [5] * 9),
        table([3.2, 3.6, 4.2, 4.6, 4.7, 4.6, 3.8, 3.1, 2.6], [3] * 9),
        np.full(24, 0.42),
    )
    # below, the roll passes into the cheek with a faint groove
    middle = lerp(crease, orbit, np.full(24, 0.48))
    fold = np.where(above[:, None], fold, middle * (1 + 0.15 / np.linalg.norm(middle, axis=1, keepdims=True)))
    straight = np.clip(
        (np.minimum(inner * np.where(above, 1, 0.5), outer * np.where(above, 1.4, 0.8)) - 0.2) / 2.2, 0, 1
    )
    out = []
    for shape, share in ((plate, 0.16), (crease, 0.38), (fold, 0.62)):
        out.append(lerp(lerp(rim, orbit, share), shape, straight))
    return out


def _cup(edge, inner, outer, above):
    """Fornix and cup (24, 3) each and the row (9, 3) that closes the cup, clear of the ball."""
    side = 1.05 * edge[:, 0]
    ramp = np.clip(np.minimum(inner, outer) / 2, 0, 1)
    angle = bearing(edge[:, 2], -edge[:, 1]) + np.radians(FORNIX) * np.where(above, 1, -1) * np.clip(
        np.minimum(inner, outer) / 3, 0, 1
    )
    depth = np.sqrt(np.maximum((RADIUS + 1.1) ** 2 - side**2, 16))
    lining = np.stack([side, -depth * np.cos(angle), depth * np.sin(angle)], axis=1)
    corner = np.where((inner < outer)[:, None], [-14.2, -3.6, -2.0], [13.2, 1.0, -0.6])
    lining = lerp(corner, lining, ramp)
    beside = (inner == 1) | (outer == 1)
    lining[beside, 2] = edge[beside, 2] + np.where(above, 1.6, -1.6)[beside]
    i = np.arange(24)
    around = np.pi + (i - 2) * 2 * np.pi / 24
    circle = np.stack([np.cos(around), np.zeros(24), np.sin(around)], axis=1)
    a = np.radians(100)
    cup = 15.2 * (np.sin(a) * circle + np.cos(a) * np.array([0, -1, 0]))
    turn = np.radians(np.linspace(-100, -260, 11)[1:-1])
    back = np.linspace(0, np.pi, 11)[1:-1]
    back = (15.2 + 4.0 * np.sin(back))[:, None] * np.stack([np.sin(turn), -np.cos(turn), np.zeros(9)], axis=1)
    return lining, cup, back
