# SPDX-License-Identifier: GPL-3.0-or-later
"""The belly of a muscle as a closed surface round its fibres, made again after every warp (Kähler 2002, 5.2, item 3).

The fibres span a muscle's middle sheet, from edge to edge. Its surface lies half a thickness to either side: rounded
across, swelling from a tendon at either end to the belly, faintly furrowed between the fibres, and never beyond the
room between skin and bone. All heads share a muscle's connectivity, which the number of its fibres and of their points
decides.
"""

from dataclasses import replace

import numpy as np

from ..mesh import Mesh
from ..progress import Work, finish
from .head import Muscle
from .muscle_bounds import Belly, bounded, bounding, sheet_normals
from .muscle_room import Room, unit

#: Share of the belly's thickness at even stations from origin to insertion, where nothing else is asked for.
SPINDLE = (0.22, 0.72, 1.0, 1.0, 0.72, 0.22)
#: Share of the thickness that the furrow between two fibres takes away.
FURROW = 0.10


def muscle_shape(
    fibres: np.ndarray, width: float, thickness: float, ring=False, room: Room | None = None, profile=SPINDLE
) -> Mesh:
    """The closed surface of a muscle.

    Parameters
    ----------
    fibres : (f, p, 3) mm, f >= 2 side by side, the outermost on the muscle's edges; a closed ring repeats no point
    width : mm of the belly: how round the edges are beside ``thickness``
    thickness : mm of the belly
    ring : a sphincter that closes on itself
    room : skin and bone that bound it; without it nothing bounds it
    profile : shares of the thickness along the fibres, at even stations (a ring has the same everywhere)
    """
    belly = belly_on(fibres, width, thickness, ring, room, profile)
    return belly_mesh(belly if room is None else bounded([belly], room)[0])


def belly_on(fibres, width: float, thickness: float, ring=False, room: Room | None = None, profile=SPINDLE) -> Belly:
    """The two sides of a muscle of `muscle_shape`'s arguments that nothing bounds; ``room`` says where the skin is."""
    sheet = muscle_sheet(fibres, ring)
    normal = frames(sheet, ring, room)[2]
    half = half_thickness(sheet, width, thickness, ring, profile)[..., None]
    return Belly(sheet + half * normal, sheet - half * normal, normal, ring)


def belly_mesh(belly: Belly) -> Mesh:
    """The closed surface of a belly: stations of its columns above, then those below without the edges."""
    return _closed_tube(_rings(belly), belly.top.shape[1], belly.ring)


def reshaped(muscle: Muscle, fibres: np.ndarray, room: Room | None = None, centre: np.ndarray | None = None) -> Muscle:
    """``muscle`` with other fibres (f, p, 3) mm and the surface that belongs to them.

    What the old surface has round each place of the old sheet, the new one has round the same place of the new sheet:
    as thick as the root of the change in length says, turned with the sheet, kept in the new ``room``.
    """
    return all_reshaped([muscle], [fibres], room, [centre])[0]


def all_reshaped(muscles, fibres, room: Room | None = None, centres=None) -> list[Muscle]:
    """`reshaping`, at once."""
    return finish(reshaping(muscles, fibres, room, centres))


def reshaping(muscles, fibres, room: Room | None = None, centres=None) -> Work:
    """Work returning `reshaped` for many muscles at once, which is quicker; ``centres`` may hold None where one stays."""
    centres = [None] * len(muscles) if centres is None else centres
    grown = [_growth(m, np.asarray(f, dtype=float)) for m, f in zip(muscles, fibres, strict=True)]
    bellies = [_carried(m, np.asarray(f, dtype=float), g) for m, f, g in zip(muscles, fibres, grown, strict=True)]
    if room is not None:
        bellies = yield from bounding(bellies, room)
    return [
        replace(
            muscle,
            fibres=np.asarray(lines, dtype=float),
            width=muscle.width * grow,
            thickness=muscle.thickness * grow,
            shape=muscle.shape.moved(_rings(belly)),
            centre=muscle.centre if centre is None else centre,
        )
        for muscle, lines, grow, belly, centre in zip(muscles, fibres, grown, bellies, centres, strict=True)
    ]


def _growth(muscle, fibres):
    return float(np.clip(_length(fibres) / max(_length(muscle.fibres), 1e-9), 0.5, 1.6)) ** 0.5


def _carried(muscle, fibres, grow) -> Belly:
    """The belly of ``muscle`` on other fibres (f, p, 3)."""
    old, new = muscle_sheet(muscle.fibres, muscle.ring), muscle_sheet(fibres, muscle.ring)
    before, after = (np.stack(frames(x, muscle.ring), axis=-2) for x in (old, new))
    columns, stations = old.shape[:2]
    rings = muscle.shape.vertices.reshape(stations, -1, 3).transpose(1, 0, 2)
    top = rings[:columns]
    low = np.concatenate([rings[:1], rings[columns:][::-1], rings[columns - 1 : columns]])
    turned = np.einsum("csji,csjk->csik", after, before)  # from the old frame to the new one
    sides = [new + grow * np.einsum("csij,csj->csi", turned, side - old) for side in (top, low)]
    normal = after[..., 2, :]
    up = np.sign(((sides[0] - sides[1]) * normal).sum()) or 1.0
    return Belly(*sides, up * normal, muscle.ring)


def recentred(muscle: Muscle, centre: np.ndarray) -> Muscle:
    """A sphincter that pulls towards another ``centre`` (3,) mm; its fibres and its surface stay.

    Raises
    ------
    ValueError : the muscle is no sphincter.
    """
    if muscle.kind != "sphincter":
        raise ValueError(f"{muscle.name} is {muscle.kind}: only a sphincter has a centre to move")
    return replace(muscle, centre=np.array(centre, dtype=float).reshape(3))


def muscle_sheet(fibres: np.ndarray, ring=False) -> np.ndarray:
    """(c, s, 3) mm: the fibres with a column between each two and a station between each two points.

    Points between are those of the interpolating four-point scheme (Dyn, Levin and Gregory 1987).
    """
    return _refined(_refined(np.asarray(fibres, dtype=float), 0, False), 1, ring)


def half_thickness(sheet: np.ndarray, width: float, thickness: float, ring=False, profile=SPINDLE) -> np.ndarray:
    """(c, s) mm from the middle sheet to the surface, before anything bounds it."""
    columns, stations = sheet.shape[:2]
    across = np.abs(np.linspace(-1, 1, columns))
    flat = np.clip(1.5 + width / max(thickness, 0.1) / 4, 2, 4)  # a thin sheet keeps its thickness to near its edge
    rounding = np.sqrt(np.maximum(1 - across**flat, 0))
    rounding[1::2] *= 1 - FURROW
    if ring:
        along = np.ones(stations)
    else:
        along = np.interp(np.linspace(0, 1, stations), np.linspace(0, 1, len(profile)), profile)
        along[1:-1] = 0.25 * along[:-2] + 0.5 * along[1:-1] + 0.25 * along[2:]
    return 0.5 * thickness * rounding[:, None] * along[None]


def frames(sheet: np.ndarray, ring=False, room: Room | None = None):
    """Unit vectors (c, s, 3) along the fibres, to the side and out of the sheet (toward the skin of ``room``)."""
    along = np.roll(sheet, -1, 1) - np.roll(sheet, 1, 1) if ring else np.gradient(sheet, axis=1)
    normal = sheet_normals(sheet, ring)
    if room is not None:
        outward = room.outward(sheet.reshape(-1, 3)).reshape(sheet.shape)
        normal = normal * (np.sign((outward * normal).sum()) or 1.0)
    along = unit(along - (along * normal).sum(-1, keepdims=True) * normal)
    return along, np.cross(normal, along), normal


def _refined(values, axis, closed):
    v = np.moveaxis(values, axis, 0)
    n = len(v)
    if closed:
        middle = (9 * (v + np.roll(v, -1, 0)) - np.roll(v, 1, 0) - np.roll(v, -2, 0)) / 16
        out = np.stack([v, middle], axis=1).reshape(2 * n, *v.shape[1:])
    else:
        ends = np.concatenate([2 * v[:1] - v[1:2], v, 2 * v[-1:] - v[-2:-1]])
        out = np.empty((2 * n - 1, *v.shape[1:]))
        out[::2] = v
        out[1::2] = (9 * (v[:-1] + v[1:]) - ends[: n - 1] - ends[3:]) / 16
    return np.moveaxis(out, 0, axis)


def _length(fibres) -> float:
    return float(np.linalg.norm(np.diff(fibres, axis=1), axis=2).sum(axis=1).mean())


def _rings(belly):
    """(n, 3) mm: the vertices of `belly_mesh`."""
    edged = belly.top.copy()
    edged[[0, -1]] = belly.middle[[0, -1]]
    return np.concatenate([edged, belly.low[1:-1][::-1]]).transpose(1, 0, 2).reshape(-1, 3)


def _closed_tube(vertices, k, ring):
    """Mesh of ``k`` cross-sections (n, 3), each over the upper side and back along the lower one."""
    m = len(vertices) // k
    j = np.arange(m)
    step = np.arange(k if ring else k - 1)
    a, b = (step * m)[:, None], ((step + 1) % k * m)[:, None]
    faces = np.stack([a + j, b + j, b + (j + 1) % m, a + (j + 1) % m], axis=-1).reshape(-1, 4)
    if not ring:
        # Caps: quads across the flat end, from edge to edge.
        half = m // 2
        over = np.arange(half + 1)
        under = (m - over) % m
        cap = np.stack([over[:-1], over[1:], under[1:], under[:-1]], axis=1)
        cap = _without_doubles(cap)
        faces = np.concatenate([faces, cap, _flipped(cap + (cap >= 0) * (k - 1) * m)])
    faces = faces.astype(np.int32)
    mesh = Mesh(vertices, faces)
    t = vertices[mesh.triangles] - vertices.mean(axis=0)
    volume = np.einsum("ij,ij->", t[:, 0], np.cross(t[:, 1], t[:, 2]))
    return mesh if volume > 0 else Mesh(vertices, _flipped(faces))


def _without_doubles(quads):
    """Quads with a repeated corner as triangles."""
    out = quads.copy()
    first = quads[:, 0] == quads[:, 3]
    out[first] = np.column_stack([quads[first][:, :3], np.full(first.sum(), -1)])
    last = (quads[:, 1] == quads[:, 2]) & ~first
    out[last] = np.column_stack([quads[last][:, [0, 1, 3]], np.full(last.sum(), -1)])
    return out


def _flipped(faces):
    quad = faces[:, 3:] >= 0
    return np.where(quad, faces[:, [0, 3, 2, 1]], faces[:, [0, 2, 1, 3]])
