# SPDX-License-Identifier: GPL-3.0-or-later
"""Gums: one closed ridge a jaw, scalloped round the necks, with papillae between the teeth, and the hard palate above.

A sheet is laid over sections of the left row (four or five to a tooth) from the cheek's side over the ridge to the tongue's
side, above on to the middle of the palate. Mirrored and given a back, it is one closed surface.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from ...sim.mesh import vertex_normals
from .mouth_room import MouthRoom
from .skin_curves import unit
from .teeth_shape import tooth_points

#: Margin of the gum: mm toward the crown from the neck at the middle of a tooth, and at the papilla's tip.
MARGIN = 0.6
PAPILLA = {"incisor": 4.6, "canine": 4.2, "premolar": 3.3, "molar": 2.9}
#: mm between the gum's face and the lining, and of its back; and that its face may lie behind the cage.
CLEAR, BACK_CLEAR, DIP = 0.9, 0.12, 0.2
#: Steps from the lingual side of the ridge to the middle of the palate.
PALATE = 6
#: From the margin away: mm toward the root, mm outward of the neck.
_FLANK = ((0.9, 0.45), (2.4, 0.9), (4.6, 1.3))


class Section(NamedTuple):
    """A cut through the ridge. centre (3,) mm at the level of the necks; out, crown (3,) unit; labial, lingual (2,): how
    far the margin stands out and up there; half: mm from the centre to the neck's faces; shrink, depth: shares of width
    and height that are left at the ends."""

    centre: np.ndarray
    out: np.ndarray
    crown: np.ndarray
    labial: np.ndarray
    lingual: np.ndarray
    half: float
    shrink: float = 1.0
    depth: float = 1.0


def gum(places, rise: int, room: MouthRoom) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) mm and faces (m, 4) of the gum round a row of teeth; ``rise`` +1 above, -1 below."""
    sections = _sections(places)
    ridge = np.array([_over_the_ridge(s) for s in sections])
    ridge[:, [0, 1, 8, 9]] = _evened(ridge[:, [0, 1, 8, 9]], 1.0)
    ridge = _inside(ridge, room)
    sheet = np.concatenate([ridge, _palate(ridge, rise, room)], axis=1) if rise > 0 else ridge
    sheet[0, :, 0] = 0.0
    return _closed(sheet, rise, room)


def _sections(places):
    """Sections from the midline to behind the last molar."""
    found, faces = [], [_Faces(p) for p in places]
    for k, face in enumerate(faces):
        if k == 0:
            found.append(_on_midline(face.section(-0.5)))
        found += [face.section(t) for t in ((-0.36, -0.14, 0.14, 0.36) if k < 3 else (-0.27, 0.0, 0.27))]
        if k + 1 < len(places):
            found.append(_between(face.section(0.5), faces[k + 1].section(-0.5)))
    return found + _end(places[-1], found[-1])


def _on_midline(s):
    flat = np.array([0.0, 1, 1])
    out, crown = (v * flat / np.linalg.norm(v * flat) for v in (s.out, s.crown))
    return s._replace(centre=s.centre * flat, out=out, crown=crown)


def _end(place, last):
    """Sections behind the last molar, where the ridge rounds off."""
    found, half = [], last.half
    for far, up, shrink in ((0.3, 1.3, 0.95), (1.6, 1.0, 0.86), (2.8, 0.0, 0.66), (3.6, -1.6, 0.4), (3.9, -3.4, 0.1)):
        centre = place.neck + (place.tooth.md_neck / 2 + far) * place.axes[0]
        margin = np.array([0.62 * half * shrink, up])
        found.append(last._replace(centre=centre, out=place.axes[1], crown=place.axes[2], labial=margin,
                                   lingual=margin * [-1, 1], shrink=shrink, depth=(5.2 + up) / 6.6))  # fmt: skip
    return found


def _between(a, b):
    """The section half way between two."""
    mean = [(np.asarray(x) + np.asarray(y)) / 2 for x, y in zip(a, b, strict=True)]
    return Section(mean[0], unit(mean[1]), unit(mean[2]), mean[3], mean[4], float(mean[5]), float(mean[6]))


class _Faces:
    """Where the faces of a tooth stand, read off its surface."""

    def __init__(self, place):
        self.place = place
        points = tooth_points(place.tooth, np.linspace(0.25, 1, 120), np.linspace(0, 1, 129)[:-1])
        self._points = points.reshape(-1, 3)

    def side(self, x, z, way):
        """y of the labial (``way`` +1) or lingual (-1) face at a point of the face."""
        p = self._points
        middle = 0.5 * (p[:, 1].max() + p[:, 1].min()) * np.clip(1 - z / self.place.tooth.crown, 0, 1)
        far = np.hypot(p[:, 0] - x, p[:, 2] - z) + np.where(way * (p[:, 1] - middle) > 0, 0, 5.0)
        near = np.argsort(far, kind="stable")[:4]
        return float(p[near, 1].mean())

    def section(self, t):
        """The section at ``t`` (-0.5 mesial .. 0.5 distal) of the tooth's width."""
        place, tooth = self.place, self.place.tooth
        share = abs(2 * t) ** 2.2
        tip = min(PAPILLA[tooth.form], 0.48 * tooth.crown)
        up = MARGIN + (tip - MARGIN) * share
        wide = tooth.md_neck + (tooth.md - tooth.md_neck) * share
        x = t * wide
        inner = np.clip(x, -0.46 * wide, 0.46 * wide)
        y = [self.side(inner, up, way) for way in (1, -1)]
        if abs(t) == 0.5:  # the papilla lies in the embrasure, behind the faces of the teeth
            depth = y[0] - y[1]
            y = [y[0] - 0.06 * depth, y[1] + 0.06 * depth]
        stand = 0.22 * (1 - share)
        centre = place.neck + x * place.axes[0]
        return Section(centre, place.axes[1], place.axes[2], np.array([y[0] + stand, up]),
                       np.array([y[1] - stand, up - 0.25 * share]), tooth.ll_neck / 2)  # fmt: skip


def _over_the_ridge(s: Section):
    """(10, 3) points from the fold of the cheek over the labial margin, the ridge and the lingual margin."""
    outline = []
    for (y, up), way in ((s.labial, 1), (s.lingual, -1)):
        stand = way * s.half * s.shrink
        flank = [(stand + way * out * s.shrink, min(up, 0.8) - down * s.depth) for down, out in _FLANK]
        flank[0] = ((flank[0][0] + y) / 2 + 0.1 * way, up - 0.55 * _FLANK[0][0] * s.depth)
        tuck = (y - way * min(1.1, 0.25 * abs(y)), up + 0.05)
        outline.append([*flank[::-1], (y, up), tuck])
    path = np.array(outline[0] + outline[1][::-1])
    return s.centre + path[:, :1] * s.out + path[:, 1:] * s.crown


def _inside(sheet, room):
    """The sheet moved off the lining of the mouth, evenly along the row."""
    shape = sheet.shape
    moved = (room.kept_in(sheet.reshape(-1, 3), CLEAR, 6, DIP) - sheet.reshape(-1, 3)).reshape(shape)
    return room.kept_in((sheet + _evened(moved, 1.2)).reshape(-1, 3), 0.6 * CLEAR, 4, DIP).reshape(shape)


def _evened(rows, sigma):
    """Values (sections, k, 3) of the left row smoothed along it, as if the right row went before."""
    whole = np.concatenate([rows[:0:-1] * [-1, 1, 1], rows])
    return gaussian_filter1d(whole, sigma, axis=0, mode="nearest")[len(rows) - 1 :]


def _palate(ridge, rise, room):
    """(sections, PALATE, 3) from the lingual flank to the middle, arched up under the roof, with a hint of rugae."""
    start, before = ridge[:, -1], ridge[:, -2]
    count = len(ridge)
    front, end = start[0, 1] + 5.0, start[:, 1].max() - 0.5
    share = np.linspace(0, 1, count) ** 1.25
    middle = np.stack([np.zeros(count), front + (end - front) * share, np.zeros(count)], axis=1)
    middle[:, 2] = room.limit(middle[:, :2], rise) - rise * CLEAR
    rising = np.interp(middle[:, 1], [start[0, 1], start[0, 1] + 16.0], [start[0, 2] + 1.0, 1e3])
    middle[:, 2] = gaussian_filter1d(np.minimum(middle[:, 2], rising), 2.0, mode="nearest")
    t = (np.arange(1, PALATE + 1) / PALATE)[:, None]
    flat = start[:, None] * (1 - t) + middle[:, None] * t
    lean = start - before  # leave the ridge along its flank, come to the middle level
    height = start[:, 2] + lean[:, 2]
    arch = 1 - (1 - t[:, 0]) ** 2.4
    flat[..., 2] = start[:, 2, None] + (middle[:, 2] - start[:, 2])[:, None] * arch + 0 * height[:, None]
    folds = np.where(np.arange(count) % 2 == 0, -1.0, 1.0) * np.interp(np.arange(count), [2, 4, 13, 17], [0, 1, 1, 0])
    flat[..., 2] += 0.28 * folds[:, None] * np.sin(np.pi * np.clip(t[:, 0] * 1.15, 0, 1)) ** 0.7
    flat[:, -1, 0] = 0.0
    roof = room.limit(flat.reshape(-1, 3)[:, :2], rise).reshape(flat.shape[:2]) - rise * CLEAR
    flat[..., 2] = np.minimum(flat[..., 2], roof)
    return flat


def _closed(sheet, rise, room):
    """Vertices and faces of the left sheet, its mirror image and a back that closes them."""
    rows, columns = sheet.shape[:2]
    left = np.arange(rows * columns).reshape(rows, columns)
    points = sheet.reshape(-1, 3)
    on_middle = np.zeros((rows, columns), bool)
    on_middle[0] = True
    on_middle[:, -1] |= rise > 0
    right = np.where(on_middle, left, left + rows * columns)
    vertices = np.concatenate([points, points * [-1, 1, 1]])
    # split along this diagonal, the corner where three vertices lie on the midline has none in common with its mirror
    quads = np.stack([left[1:, :-1], left[1:, 1:], left[:-1, 1:], left[:-1, :-1]], axis=-1).reshape(-1, 4)
    other = np.stack([right[1:, :-1], right[:-1, :-1], right[:-1, 1:], right[1:, 1:]], axis=-1).reshape(-1, 4)
    faces = np.concatenate([quads, other])
    if rise > 0:
        faces = faces[:, [0, 3, 2, 1]]
    used = np.unique(faces)
    new = np.full(len(vertices), -1)
    new[used] = np.arange(len(used))
    vertices, faces = vertices[used], new[faces]
    triangles = np.concatenate([faces[:, :3], faces[:, [0, 2, 3]]])
    normal = vertex_normals(vertices, triangles)
    deep = np.full((2, rows, columns), 0.6)
    deep[..., [0, 2, 4, 5, 7]] = 0.4, 1.7, 1.0, 1.0, 1.7
    back = _behind(vertices, normal, deep.ravel()[used], room)
    back = (back + _mirror(vertices, back)) / 2
    return _backed(vertices, back, faces, new[left], new[right])


def _behind(vertices, normal, deep, room):
    """Points under a sheet, ``deep`` (n,) mm down or less where the lining of the mouth is near."""
    back = vertices.copy()
    for share in (0.2, 0.35, 0.5, 0.7, 1.0):
        lower = vertices - (share * deep)[:, None] * normal
        free = (room.clearance(lower)[0] > BACK_CLEAR) & (room.behind_cage(lower)[0] < DIP + 0.15)
        back[free] = lower[free]
    return back


#: Columns of the sheet that its back keeps, below and above.
_KEPT = {10: (0, 2, 4, 5, 7, 9), 10 + PALATE: (0, 2, 4, 5, 7, 9, 11, 13, 15)}


def _backed(vertices, back, faces, left, right):
    """The sheet joined with a back of fewer columns; left, right: (rows, columns) index of its vertices."""
    kept = np.array(_KEPT[left.shape[1]])
    of = kept[np.abs(np.arange(left.shape[1])[:, None] - kept).argmin(axis=1)]  # column -> the nearest one kept
    used = np.unique(np.concatenate([left[:, kept].ravel(), right[:, kept].ravel()]))
    to = np.full(len(vertices), -1)
    to[used] = len(vertices) + np.arange(len(used))
    behind = np.arange(len(vertices))
    for side in (left, right):
        behind[side] = to[side[:, of]]
    rim = _boundary(faces)
    sides = np.stack([rim[:, 1], rim[:, 0], behind[rim[:, 0]], behind[rim[:, 1]]], axis=1)
    whole = np.concatenate([behind[faces[:, [0, 3, 2, 1]]], sides])
    return np.concatenate([vertices, back[used]]), np.concatenate([faces, _plain(whole)]).astype(np.int32)


def _plain(quads):
    """Quads with repeated corners made triangles (-1 last) or dropped."""
    out = []
    for quad in quads.tolist():
        corners = [c for k, c in enumerate(quad) if c != quad[k - 1]]
        if len(set(corners)) == len(corners) >= 3:
            out.append(corners + [-1] * (4 - len(corners)))
    return np.array(out)


def _mirror(vertices, values):
    from scipy.spatial import cKDTree

    return values[cKDTree(vertices).query(vertices * [-1, 1, 1])[1]] * [-1, 1, 1]


def _boundary(faces):
    """(b, 2) directed edges that only one quad has."""
    directed = np.concatenate([faces[:, [k, (k + 1) % 4]] for k in range(4)])
    span = int(faces.max()) + 1
    forth, back = directed[:, 0] * span + directed[:, 1], directed[:, 1] * span + directed[:, 0]
    return directed[~np.isin(forth, back)]
