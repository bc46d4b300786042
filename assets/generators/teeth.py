# SPDX-License-Identifier: GPL-3.0-or-later
"""Two rows of sixteen teeth with their gums, placed behind the closed lips inside the mouth."""

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import cKDTree

from ...sim.mesh import Mesh
from .skull_depth import sampled
from .skull_field import curve
from .teeth_shape import LOWER, UPPER, crown

#: Outer face of the upper arch from above: mm lateral, mm behind the incisors (adult means: 34 mm between canines,
#: 47 mm between first molars, 28 mm deep to the first molar).
ARCH = np.array(
    [(0, 0), (8.3, 1.2), (14.5, 4.6), (20, 10.5), (24.5, 18), (27.5, 26), (30, 36), (31, 45), (30.5, 54)], float
)
#: mm between the lining of the mouth and the teeth.
LIP_GAP = 1.3
#: Biting edge of the upper incisors below the mouth line, mm; overlap of the rows at rest.
SHOW, OVERBITE, OVERJET = 1.6, 1.4, 2.6
GUM_AROUND = 10


class Mouth:
    """The room inside the mouth: measured on the lining of the bag.

    front, back : y of its front and back walls; half : half its width; floor : lowest z
    """

    def __init__(self, skin: Mesh, groups, landmarks):
        bag = skin.vertices[np.asarray(groups["mouth_bag"]) > 0.5]
        self.line = float(landmarks["sto"][2])
        middle = bag[np.abs(bag[:, 0]) < 5]
        self.front = float(middle[:, 1].min())
        self.back = float(bag[:, 1].max())
        self.half = float(bag[:, 0].max())
        lining = skin.triangles[(np.asarray(groups["mouth_bag"])[skin.triangles] > 0.5).all(axis=1)]
        points, self._wall_normals = sampled(skin.vertices, lining, 1.5)
        self._walls = cKDTree(points)
        self.floor = float(bag[:, 2].min())
        high, low = bag[bag[:, 2] > self.line + 0.2], bag[bag[:, 2] < self.line - 0.2]
        self._ceiling = LinearNDInterpolator(high[:, :2], high[:, 2])
        self._ground = LinearNDInterpolator(low[:, :2], low[:, 2])

    def limit(self, xy, rise):
        """(k,) z of the mouth's roof (``rise`` +1) or floor (-1) over or under points (k, 2)."""
        found = (self._ceiling if rise > 0 else self._ground)(xy)
        return np.where(np.isfinite(found), found, self.line + rise * 5.0)

    def kept_in(self, mesh: Mesh, clear=0.4) -> Mesh:
        """``mesh`` with the few vertices that touch the mouth's lining moved off it."""
        vertices = mesh.vertices.copy()
        for _ in range(3):
            distance, near = self._walls.query(vertices)
            height = ((vertices - self._walls.data[near]) * self._wall_normals[near]).sum(1)
            move = np.where(distance < 6, np.maximum(clear - height, 0), 0)
            vertices += move[:, None] * self._wall_normals[near]
        return mesh.moved(vertices)


def make_teeth(skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray]) -> tuple[Mesh, Mesh]:
    """(upper, lower) teeth with gums; materials index `MATERIALS["teeth_upper"]` (enamel, gum)."""
    mouth = Mouth(skin, groups, landmarks)
    long = mouth.back - 3.0 - (mouth.front + LIP_GAP)
    scale = np.array([(mouth.half - 3.2) / ARCH[:, 0].max(), min(1.0, long / ARCH[-1, 1])])
    outer = curve(ARCH * scale, 400) + [0, mouth.front + LIP_GAP]
    edge = mouth.line - SHOW
    upper = _row(UPPER, outer, edge, +1, mouth)
    # The lower row bites inside the upper.
    inward = _normals(outer)
    setback = np.interp(np.linspace(0, 1, len(outer)), [0, 0.25, 0.5, 1], [OVERJET, 2.4, 1.6, 1.4])
    lower = _row(LOWER, outer - inward * setback[:, None], edge + OVERBITE, -1, mouth)
    return mouth.kept_in(upper), mouth.kept_in(lower)


def incisor_edge(teeth_lower: Mesh) -> np.ndarray:
    """(3,) mm, the point between the biting edges of the lower middle incisors."""
    enamel = np.unique(teeth_lower.faces[teeth_lower.material == 0][:, :3])
    near = teeth_lower.vertices[enamel]
    near = near[np.abs(near[:, 0]) < 4.0]
    edge = near[near[:, 2] > near[:, 2].max() - 0.6].mean(axis=0)
    return edge * [0, 1, 1]


def _row(teeth, outer, edge, rise, mouth):
    """One row: ``outer`` (k, 2) the labial line of the left side, ``edge`` z of the incisors, ``rise`` +1 upper, -1 lower."""
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(outer, axis=0), axis=1))])
    normal = _normals(outer)
    need = sum(t.md for t in teeth)
    # Outer line to the line through the contact points, where the widths add up.
    fit = min(1.0, 0.93 * length[-1] / need)
    parts, at = [], 0.0
    necks = []
    for number, tooth in enumerate(teeth):
        tooth = tooth._replace(md=tooth.md * fit, md_neck=tooth.md_neck * fit, ll=tooth.ll * (0.4 + 0.6 * fit),
                               ll_neck=tooth.ll_neck * (0.4 + 0.6 * fit))  # fmt: skip
        middle = (at + tooth.md / 2) / (need * fit)
        at += tooth.md
        s = middle * length[-1] * 0.985
        place = np.array([np.interp(s, length, outer[:, 0]), np.interp(s, length, outer[:, 1])])
        out = np.array([np.interp(s, length, normal[:, 0]), np.interp(s, length, normal[:, 1])])
        out /= np.linalg.norm(out)
        spee = _spee(middle, rise)
        biting = edge + spee
        vertices, faces = crown(tooth)
        vertices[:, 1] -= vertices[:, 1].max()
        lean = 0.10 if number < 3 else 0.03
        vertices[:, 1] += lean * (vertices[:, 2] - tooth.length) * (1 if number < 3 else -1)
        local = np.stack([np.array([-out[1], out[0]]), out])
        flat = vertices[:, :2] @ local + place
        up = biting + rise * (tooth.length - vertices[:, 2])
        if rise > 0:
            faces = np.where(faces[:, 3:] >= 0, faces[:, [0, 3, 2, 1]], faces[:, [0, 2, 1, 3]])
        room = mouth.limit(flat, rise) - rise * 1.0
        up = np.where(rise * (up - room) > 0, room, up)
        parts.append((np.column_stack([flat, up]), faces, 0))
        deep = place - out * (tooth.ll * 0.5)
        necks.append((deep, out, biting + rise * tooth.length, tooth))
    both = []
    for vertices, faces, kind in parts:
        both.append((vertices, faces, kind))
        mirrored = np.where(faces[:, 3:] >= 0, faces[:, [0, 3, 2, 1]], faces[:, [0, 2, 1, 3]])
        both.append((vertices * [-1, 1, 1], mirrored, kind))
    both.append((*_gum(necks, rise, mouth), 1))
    return _merged(both)


def _spee(share, rise):
    """Height of the biting edge along the row against that of the incisors, mm: canine tip, then the curve of Spee."""
    heights = [0, -0.1, 0.2, 0.4, 0.6, 1.2, 1.9, 2.8] if rise > 0 else [0, -0.1, -0.9, -1.3, -1.4, -1.1, -0.3, 0.6]
    return float(np.interp(share * 8 - 0.5, np.arange(8), heights))


def _gum(necks, rise, mouth):
    """The gum: a band swept along the necks of all sixteen teeth, its margin scalloped. Vertices and faces."""
    place = np.array([p for p, *_ in necks])
    out = np.array([o for _, o, *_ in necks])
    neck = np.array([z for *_, z, _ in necks])
    thick = np.array([t.ll_neck / 2 + 0.9 for *_, t in necks])
    ends = lambda a, k=1.0: np.concatenate([a, a[-1:] + k * (a[-1:] - a[-2:-1])])  # noqa: E731
    place, out, neck, thick = ends(place, 0.62), ends(out, 0.0), ends(neck, 0.4), np.append(thick, thick[-1] * 0.75)
    # Whole row from right to left, three stations a tooth: middle and both gaps.
    row = lambda a, flip: np.concatenate([a[::-1] * flip, a])  # noqa: E731
    place, out = row(place, [-1, 1]), row(out, [-1, 1])
    neck, thick = row(neck, 1), row(thick, 1)
    count = 3 * (len(neck) - 1) + 1
    place, out = curve(place, count), curve(out, count)
    neck, thick = curve(neck[:, None], count)[:, 0], curve(thick[:, None], count)[:, 0]
    station = np.arange(count) / 3
    papilla = 0.5 - 0.5 * np.cos(2 * np.pi * station)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    sides = np.stack([place + out * thick[:, None] * q for q in (-0.8, -0.4, 0.0, 0.4, 0.8)])
    room = np.stack([rise * mouth.limit(xy, rise) for xy in sides])
    limit = rise * room.max(axis=0)
    margin = neck - rise * (0.6 + 1.7 * papilla)
    top = np.where(rise * (limit - neck) > 9.0, neck + rise * 9.0, limit + rise * 1.5)
    turn = 2 * np.pi * np.arange(GUM_AROUND) / GUM_AROUND
    c, s = np.cos(turn), np.sin(turn)
    side = np.sign(c) * np.abs(c) ** 0.7 * (1 - 0.12 * s)
    centre_z, half_z = (margin + top) / 2, (margin - top) / 2
    swell = thick[:, None] * (1 - 0.08 * papilla[:, None]) * side[None]
    xy = place[:, None] + swell[..., None] * out[:, None]
    z = centre_z[:, None] + half_z[:, None] * s[None]
    roof = mouth.limit(xy.reshape(-1, 2), rise).reshape(z.shape) - rise * 0.7
    z = np.where(rise * (z - roof) > 0, roof, z)
    rings = np.concatenate([xy, z[..., None]], axis=2)
    vertices = np.concatenate([rings.reshape(-1, 3), [rings[0].mean(0), rings[-1].mean(0)]])
    n = GUM_AROUND
    j = np.arange(n)
    k = (j + 1) % n
    none = np.full(n, -1)
    faces = [np.stack([np.full(n, count * n), k, j, none], axis=1)]
    for i in range(count - 1):
        a, b = i * n, (i + 1) * n
        faces.append(np.stack([a + j, a + k, b + k, b + j], axis=1))
    a = (count - 1) * n
    faces.append(np.stack([np.full(n, count * n + 1), a + j, a + k, none], axis=1))
    faces = np.concatenate(faces).astype(np.int32)
    return vertices, _outward(vertices, faces)


def _outward(vertices, faces):
    """``faces`` turned so that the volume they enclose is positive."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->", a - vertices.mean(0), np.cross(b - vertices.mean(0), c - vertices.mean(0)))
    quad = faces[:, 3] >= 0
    a, b, c = (vertices[faces[quad][:, k]] for k in (0, 2, 3))
    volume += np.einsum("ij,ij->", a - vertices.mean(0), np.cross(b - vertices.mean(0), c - vertices.mean(0)))
    return faces if volume > 0 else np.where(quad[:, None], faces[:, [0, 3, 2, 1]], faces[:, [0, 2, 1, 3]])


def _normals(line):
    """(k, 2) unit normals of a planar line (k, 2), to the outside of the arch."""
    along = np.gradient(line, axis=0)
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def _merged(pieces):
    vertices, faces, material, start = [], [], [], 0
    for v, f, kind in pieces:
        f = _outward(v, f)
        vertices.append(v)
        faces.append(np.where(f >= 0, f + start, -1))
        material.append(np.full(len(f), kind, np.int16))
        start += len(v)
    return Mesh(np.concatenate(vertices), np.concatenate(faces).astype(np.int32), material=np.concatenate(material))
