# SPDX-License-Identifier: GPL-3.0-or-later
"""The rim of an alveolar process with its sockets, as a strip of quads made tooth by tooth.

Every tooth has a socket of eight sides round its root; between two sockets stands a septum. The outer wall swells over
each root (juga alveolaria), most over the canine's.
"""

import numpy as np

from ...sim.mesh import Mesh
from .skull_arch import DentalArch
from .teeth_shape import built_root

#: mm between a root and its socket; the rows of the walls, mm from the crest.
PLAY = 0.4
ROWS = (0.0, 1.6, 4.2, 7.2)
#: Depth of a socket, mm, and what bone there must remain round its end.
DEEP, REMAIN = 10.0, 0.8
#: mm of bone between a socket and the wall of the ridge.
PLATE = 0.35
#: Swelling over the roots, mm: incisors, canine, premolars, molars.
JUGA = np.array([0.25, 0.25, 0.9, 0.35, 0.3, 0.3, 0.2, 0.1])


def heights(arch: DentalArch) -> tuple[float, ...]:
    """mm from the crest to the rows of the walls: less in the upper jaw, where the palate is near."""
    return tuple(up * (0.55 if arch.rise > 0 else 0.8) for up in ROWS)


def socket_strip(arch: DentalArch, field) -> Mesh:
    """The left half of the ridge's rim, open below its walls.

    arch : where the teeth stand; field : the bone as a function of points, which the sockets must stay within
    """
    teeth = len(arch.places)
    gaps = np.concatenate([[0.0], (arch.at_tooth[1:] + arch.at_tooth[:-1]) / 2, [0.0]])
    gaps[-1] = min(2 * arch.at_tooth[-1] - gaps[-2], arch.length[-1] - 2.5)
    stations = np.sort(np.concatenate([gaps, arch.at_tooth]))  # gap, tooth, gap, … gap
    count = 2 * teeth + 1
    jugum = np.zeros(count)
    jugum[1::2] = JUGA
    jugum[2:-1:2] = -0.35 * (JUGA[:-1] + JUGA[1:])
    dip = np.where(np.arange(count) % 2, 0.0, -0.3)  # the septa stand higher
    outer, inner = [], []
    for up in heights(arch):
        swell = jugum * np.clip(up / 2.0, 0, 1)
        free = arch.stand(stations, +1, up + 1.0)  # where there is no room the wall cannot swell
        swell = np.minimum(swell, np.maximum(free - arch.stand(stations, +1, up), 0.0))
        outer.append(arch.wall(stations, +1, up + dip * (up == 0), swell))
        inner.append(arch.wall(stations, -1, up + dip * (up == 0), 0.0))
    outer, inner = np.array(outer), np.array(inner)
    crest = arch.wall(gaps, 0, -0.5, 0.0)
    end = np.array([arch.wall(stations[-1:] + 1.4 + 0.25 * up, 0, up, 0.0)[0] for up in heights(arch)])
    rows = len(ROWS)
    # Numbers: outer rows, inner rows, septa, end.
    o = np.arange(rows * count).reshape(rows, count)
    i = o + rows * count
    c = 2 * rows * count + np.arange(teeth + 1)
    e = c[-1] + 1 + np.arange(rows)
    vertices = [outer.reshape(-1, 3), inner.reshape(-1, 3), crest, end]
    faces = []
    for k in range(rows - 1):
        faces.append(np.stack([o[k, :-1], o[k, 1:], o[k + 1, 1:], o[k + 1, :-1]], axis=1))
        faces.append(np.stack([i[k, 1:], i[k, :-1], i[k + 1, :-1], i[k + 1, 1:]], axis=1))
        faces.append([[o[k, -1], e[k], e[k + 1], o[k + 1, -1]], [e[k], i[k, -1], i[k + 1, -1], e[k + 1]]])
    faces.append([[o[0, -1], c[-1], i[0, -1], e[0]]])
    start = e[-1] + 1
    sockets = _sockets(arch, field)
    for t in range(teeth):
        a = 2 * t
        ring = np.array([o[0, a], o[0, a + 1], o[0, a + 2], c[t + 1], i[0, a + 2], i[0, a + 1], i[0, a], c[t]])
        rings, bottom = sockets[0][t], sockets[1][t]
        size = len(rings)
        number = start + np.arange(8 * size).reshape(size, 8)
        loops = [ring, *number]
        for first, second in zip(loops[:-1], loops[1:], strict=True):
            n, m = np.roll(first, -1), np.roll(second, -1)
            faces.append(np.stack([first, second, m, n], axis=1))
        last, b = loops[-1], start + 8 * size
        faces.append([[b, last[(k + 2) % 8], last[k + 1], last[k]] for k in (0, 2, 4, 6)])
        vertices += [rings.reshape(-1, 3), bottom[None]]
        start = b + 1
    vertices, faces = np.concatenate(vertices), np.concatenate(faces)
    vertices[np.r_[o[:, 0], i[:, 0], c[:1]], 0] = 0.0
    if arch.rise < 0:
        faces = faces[:, [0, 3, 2, 1]]
    return Mesh(vertices, faces.astype(np.int32))


def _sockets(arch: DentalArch, field):
    """Rings (teeth, 3, 8, 3) from the rim down and bottoms (teeth, 3) of the sockets."""
    places = arch.places
    centre, axis = arch.spots, np.array([p.axis for p in places])
    turn = np.radians([-135, -90, -45, 0, 45, 90, 135, 180])  # from the outer mesial corner
    # A rounded rectangle, mesial to distal along x, labial along y.
    box = np.stack([np.cos(turn), -np.sin(turn)], axis=1)
    box /= np.abs(box).max(axis=1, keepdims=True) ** 0.55
    half = np.array([(p.md_neck / 2 + PLAY, p.ll_neck / 2 + PLAY) for p in places])
    flat = box[None] * half[:, None]
    round_ = np.einsum("tkc,tcx->tkx", flat, np.array([p.axes[:2] for p in places]))

    depths = np.arange(2.0, DEEP + 0.1, 0.5)
    ends = centre[:, None, None] + (axis[:, None] * depths[:, None])[:, :, None] + 0.6 * round_[:, None]
    free = field(ends.reshape(-1, 3)).reshape(ends.shape[:3]).max(axis=2) < -REMAIN
    last = np.where(free.all(axis=1), len(depths), free.argmin(axis=1)) - 1
    crest = np.linalg.norm(centre - [p.neck for p in places], axis=1)
    deep = np.clip(
        depths[np.maximum(last, 0)], 2.0, np.maximum([built_root(p.tooth) + PLAY for p in places] - crest, 4.0)
    )
    levels = ((0.0, 1.0), (0.35, 0.92), (0.85, 0.66))
    rings = np.stack([centre[:, None] + (axis * (d * deep)[:, None])[:, None] + s * round_ for d, s in levels], axis=1)
    return _within(arch, rings.reshape(-1, 3)).reshape(rings.shape), centre + axis * deep[:, None]


def _within(arch: DentalArch, points):
    """``points`` (n, 3) drawn in to where `PLATE` mm of bone remain between them and the walls of the ridge."""
    away, tall, near = arch.local(points)
    wall = np.where(away > 0, *(arch.stand(arch.length[near], side, tall) for side in (1, -1)))
    beyond = np.maximum(np.abs(away) - (wall - PLATE), 0) * np.sign(away)
    return points - np.column_stack([arch.out[near] * beyond[:, None], np.zeros(len(points))])
