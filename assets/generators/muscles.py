# SPDX-License-Identifier: GPL-3.0-or-later
"""The muscles of face and jaw of ``assets/tables/muscles.csv``, laid into the soft tissue of the reference head.

Each is a grid painted on the skin (`muscles_points`), dropped to its depth (`muscles_room`), deepest first, so that it
slides over those below (`muscles_layers`); muscles that merge end in the same nodes.
"""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...sim.adapt.closest import Surface
from ...sim.anatomy.head import Eye, Jaw, Muscle
from ...sim.anatomy.muscle_bounds import bounded, eased
from ...sim.anatomy.muscle_room import Room, unit
from ...sim.anatomy.muscle_shape import belly_mesh, belly_on, half_thickness
from ...sim.mesh import Mesh
from .muscles_layers import MERGE, Layers
from .muscles_points import BROW, BROW_NODES, MODIOLUS_NODES, grid_rows, left_points, point, shared_ends
from .muscles_rings import lid_rings, lip_arcs, orbital_rings
from .muscles_room import Tissue, calmed, evened
from .skull_depth import BoneSpace
from .skull_field import curve

TABLE = Path(__file__).resolve().parents[1] / "tables" / "muscles.csv"
MIRROR = np.array([-1.0, 1.0, 1.0])
#: mm of skin over any vertex of a muscle: a `Room` of samples leaves less where skin turns into the lids' lining.
LEAST_SKIN = 0.35


def rows() -> list[dict[str, str]]:
    """The table's rows, one muscle (pair) each."""
    with open(TABLE, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def make_muscles(
    skin: Mesh,
    groups: dict[str, np.ndarray],
    landmarks: dict[str, np.ndarray],
    parts: dict[str, Mesh],
    skull_landmarks: dict[str, np.ndarray],
    jaw: Jaw,
    eyes: tuple[Eye, Eye],
) -> tuple[Muscle, ...]:
    """Every muscle of the table, paired ones as ``_l`` and ``_r`` mirror images.

    ``parts`` holds ``skull`` and ``mandible``; lengths in mm.
    """
    space = BoneSpace(skin, groups, landmarks)
    space.targets.update(skull_landmarks)
    bones = [parts["skull"], parts["mandible"]]
    maker = _Maker(skin, groups, space, bones, eyes)
    table = rows()
    made = {row["name"]: maker.muscles(row) for row in sorted(table, key=lambda row: float(row["level"]))}
    return tuple(muscle for row in table for muscle in made[row["name"]])


class _Maker:
    def __init__(self, skin, groups, space, bones, eyes):
        self.eye = eyes[0]
        self.points = left_points(space, self.eye)
        inner = np.asarray(groups["inner"]) > 0.5
        self.seen = Surface(skin.vertices, skin.triangles[~inner[skin.triangles].all(axis=1)])
        self.room = Room(skin, bones, inner, [(e.centre, e.radius) for e in eyes])
        self.tissue = Tissue(self.room, skin, groups)
        self.points.update(self.tissue.lower_end())
        self.layers = Layers()
        self.bones = dict(zip(("skull", "mandible"), self.room.bones, strict=True))
        self.palpebral = None
        self._shared_nodes()

    def _shared_nodes(self):
        """Where muscles grow into each other: the knot beside the mouth corner and the line under the eyebrow."""
        p = self.points
        knot = p["k:ch"] + np.array([8.5, 5.0, -1.5]) + np.linspace(4.4, -4.4, MODIOLUS_NODES)[:, None] * [0, 0, 1]
        brow = curve([point(text, p) for text in BROW], BROW_NODES)
        glabella = np.array([p["k:g"] + [0, 0, 4.0]])
        for name, line, share in (("modiolus", knot, 0.5), ("brow", brow, 0.5), ("glabella", glabella, 0.5)):
            foot, normal = self.tissue.foot(line)
            if name == "glabella":
                foot, normal = foot * [0, 1, 1], normal * [0, 1, 1]
            deep = np.clip(share * self.tissue.thickness(foot, normal), 1.5, 5.0)
            for k, at in enumerate(self.room.fitted(foot - deep[:, None] * normal)):
                p[f"m:{name}{k}" if len(line) > 1 else f"m:{name}"] = at
                p[f"m:r{name}{k}"] = at * MIRROR

    def muscles(self, row):
        """One muscle, or the left and the right one."""
        ring = row["path"].startswith(("ring", "lids"))
        paired = row["paired"] == "1"
        fibres, keep, centre = self.fibres(row)
        if not paired:
            fibres, keep = _symmetric(fibres, row), np.minimum(keep, _mirrored(keep[..., None], row)[..., 0])
        level = float(row["level"])
        fibres = self.eased(row, fibres, keep, ring)
        if not paired:
            fibres = _symmetric(fibres, row)
        fibres, shape = self._laid(row, fibres, keep, ring, level)
        self.layers.add(level, shape, paired)
        width, thickness = float(row["width_mm"]), float(row["thickness_mm"])
        muscle = Muscle(row["name"], row["kind"], fibres, width, thickness, float(row["max_shortening"]),
                        row["origin_part"], row["insertion_part"], shape, ring, centre)  # fmt: skip
        self._name_nodes(row, fibres)
        return [replace(muscle, name=row["name"] + "_l"), _other_side(muscle)] if paired else [muscle]

    def _half(self, row, fibres, ring):
        """(f, p) mm of belly to either side of a fibre's points, and what of it must stay clear of bone."""
        columns, points = 2 * len(fibres) - 1, fibres.shape[1]
        sheet = np.empty((columns, 2 * points if ring else 2 * points - 1, 3))
        half = half_thickness(sheet, float(row["width_mm"]), float(row["thickness_mm"]), ring, _profile(row))[::2, ::2]
        half[[0, -1]] = 0.6 * half[[1, -2]]
        clear = 0.9 * half
        if not ring:  # where a muscle springs from bone its sheet lies on it
            rise = np.clip(np.linspace(0, 1, points) / 0.22, 0, 1)
            if row["origin_part"] != "soft":
                clear = clear * rise
            if row["insertion_part"] != "soft":
                clear = clear * rise[::-1]
        return half, clear + 0.15

    def eased(self, row, fibres, keep, ring):
        """Fibres bent clear of bone, lining and skin by some of their belly, and calm again; shared nodes stay."""
        clear = 0.5 * self._half(row, fibres, ring)[1]
        if row["kind"] == "sphincter":  # laid along an edge: walls all round would drive it back from there
            clear = np.minimum(clear, 0.1)
        beside = 1.0 if row["depth"] == "deep" else 0.25
        for _ in range(2):
            bent = eased([fibres], [keep], [clear], [ring], self.room, rounds=4, beside=beside)[0]
            bent = bent if ring else calmed(bent, (bent.shape[1] + 3) // 2, 5 if row["path"].startswith("arc") else 3)
            fibres = held(bent, fibres, keep)
        return fibres

    def _laid(self, row, fibres, keep, ring, level):
        """The fibres in the middle of their belly, and its surface, in its room and over what lies deeper."""
        width, thickness = float(row["width_mm"]), float(row["thickness_mm"])
        fade = np.interp(np.arange(_stations(fibres, ring)) / 2, np.arange(keep.shape[1]), keep.min(axis=0))
        for rounds in (2, 2, 4):
            belly = replace(belly_on(fibres, width, thickness, ring, self.room, _profile(row)), free=fade)
            belly = bounded([belly], self.room, rounds, self.layers.floor(level), _cover(level), rounds == 4)[0]
            if rounds == 2:
                fibres = fibres + keep[..., None] * (belly.middle[::2, ::2] - fibres)
                fibres = self.eased(row, fibres, keep, ring)
                if row["paired"] != "1":
                    fibres = _symmetric(fibres, row)
        shape = self._under_skin(belly_mesh(belly))
        if row["paired"] == "1":
            return fibres, shape
        columns, stations = belly.top.shape[:2]
        rings = shape.vertices.reshape(stations, 2 * columns - 2, 3)
        if row["kind"] == "sphincter":
            other = rings[::-1]
        else:
            turn = np.concatenate([np.arange(columns)[::-1], np.arange(columns, 2 * columns - 2)[::-1]])
            other = rings[:, turn]
        return fibres, shape.moved(((rings + other * MIRROR) / 2).reshape(-1, 3))

    def _under_skin(self, shape):
        """``shape`` with what lies nearer than `LEAST_SKIN` under the skin one sees, beside the lids' edges, moved off it."""
        skin = self.seen.closest(shape.vertices)
        off = unit(shape.vertices - skin.points)
        return shape.moved(shape.vertices + np.clip(LEAST_SKIN - skin.distance, 0, None)[:, None] * off)

    def _name_nodes(self, row, fibres):
        """Let others end in this muscle: the lips' fibres and the outermost of the lids' rings."""
        if row["path"].startswith("arc"):
            inside = fibres[-2, fibres.shape[1] // 2 :]
            self.points.update({f"m:{row['name'].split('_')[-1]}{k}": at for k, at in enumerate(inside)})
        elif row["path"].startswith("lids"):
            self.palpebral = fibres[0]

    def fibres(self, row):
        """Fibres (f, p, 3), how free each point is (f, p) (0 at shared nodes) and the centre of a sphincter (or None)."""
        text, count = row["path"], int(row["fibres"])
        front = self.eye.centre + [0, -self.eye.radius, 0]
        if text.startswith("lids"):
            rings = lid_rings(text, count, self.points, self.eye)
            return rings, np.ones(rings.shape[:2]), front
        if text.startswith("ring"):
            rings = orbital_rings(text, count, self.points, self.palpebral, self.tissue, float(row["depth"]))
            keep = np.tile(np.linspace(1, 0, count)[:, None] ** 0.5, (1, rings.shape[1]))
            return rings, keep, front
        if text.startswith("arc"):
            arcs = lip_arcs(text, count, self.points, self.tissue, float(row["depth"]))
            return arcs, _fading(arcs, True, True), self.points["k:sto"] + [0.0, 4.0, 0.0]
        return *self._grid(row, text, count), None

    def _grid(self, row, text, count):
        steps = int(row["steps"])
        corners = grid_rows(text, self.points, count)
        lines = np.stack([curve(corners[:, k], steps) for k in range(count)])
        tokens = row["depth"].split()
        if tokens == ["deep"]:
            placed = lines
        else:
            feet, normal, deep = self.tissue.painted(lines)
            half = self._half(row, lines, False)[0]
            depth = {"on": deep - half - 0.2, "root": deep - 0.1}
            stations = np.linspace(0, len(tokens) - 1, steps)
            placed = np.zeros_like(lines)
            for k, token in enumerate(tokens):
                share = np.clip(1 - np.abs(stations - k), 0, 1)[None, :, None]
                if token == "free":
                    placed += share * lines
                    continue
                down = depth[token] if token in depth else np.maximum(float(token) * deep, half + 0.8)
                placed += share * (feet - down[..., None] * normal)
        placed = calmed(self._rooted(placed, row), len(corners) + 1)
        nodes = shared_ends(text, count)
        keep = np.ones(lines.shape[:2])
        fade = _eased(np.linspace(0, 1, steps))[:, None]
        for k, name in enumerate(nodes):
            if name is not None:
                placed[k] += fade * (self.points[name] - placed[k, -1])
                placed[k, -1] = self.points[name]
        if any(nodes):
            keep = _fading(placed, False, True)
            keep[[k for k, name in enumerate(nodes) if name is None]] = 1.0
        return placed, keep

    def _rooted(self, fibres, row, reach=14.0):
        """Fibres whose ends on bone are brought onto it where they hang more than some mm before it."""
        for part, end in ((row["origin_part"], 0), (row["insertion_part"], -1)):
            if part not in self.bones:
                continue
            bone = self.bones[part]
            at = fibres[:, end]
            far = np.abs(bone.height(at, reach)[0])
            shift = np.where((np.isfinite(far) & (far > 3.0))[:, None], bone.nearest(at) - at, 0.0)
            shift = evened(shift[:, None], 2)[:, 0] if len(shift) > 2 else shift
            fade = np.clip(1 - np.linspace(0, 1, fibres.shape[1]) / 0.45, 0, 1) ** 2
            fibres = fibres + (fade if end == 0 else fade[::-1])[None, :, None] * shift[:, None]
        return fibres


def _fading(fibres, first, last):
    """(f, p) 0 at the ends named, 1 from `MERGE` mm on."""
    step = np.linalg.norm(np.diff(fibres, axis=1), axis=2)
    along = np.concatenate([np.zeros((len(fibres), 1)), np.cumsum(step, axis=1)], axis=1)
    out = np.ones(along.shape)
    for wanted, away in ((first, along), (last, along[:, -1:] - along)):
        if wanted:
            out = np.minimum(out, np.clip(away / MERGE, 0, 1))
    return out


def _cover(level):
    """mm that a muscle of this ``level`` leaves to those over it."""
    return float(np.interp(level, (1.0, 1.5, 2.0, 2.5, 3.0), (1.2, 0.5, 0.8, 0.6, 0.0)))


def _stations(fibres, ring):
    return 2 * fibres.shape[1] - (not ring)


def held(fibres, ends, keep):
    """Fibres (f, p, 3) drawn to where ``ends`` (f, p, 3) end wherever an end is shared (``keep`` (f, p) is 0)."""
    t = np.linspace(0, 1, fibres.shape[1])
    for end, fade in ((0, _eased(1 - t)), (-1, _eased(t))):
        shift = np.where((keep[:, end] <= 0)[:, None], ends[:, end] - fibres[:, end], 0.0)
        fibres = fibres + fade[:, None] * shift[:, None]
    return fibres


def _eased(t):
    """0 to 1 with no kink at either end."""
    return t * t * (3 - 2 * t)


def _profile(row):
    return [float(x) for x in row["profile"].split()]


def _mirrored(values, row):
    """The mirror image of a midline muscle, its fibres or its points in the matching order."""
    flipped = values * (MIRROR if values.shape[-1] == 3 else 1.0)
    return flipped[:, ::-1] if row["kind"] == "sphincter" else flipped[::-1]


def _symmetric(fibres, row):
    return (fibres + _mirrored(fibres, row)) / 2


def _other_side(muscle):
    """The right muscle of a pair."""
    faces = muscle.shape.faces
    faces = np.where(faces[:, 3:] >= 0, faces[:, [0, 3, 2, 1]], faces[:, [0, 2, 1, 3]])
    return replace(
        muscle,
        name=muscle.name + "_r",
        fibres=muscle.fibres * MIRROR,
        shape=Mesh(muscle.shape.vertices * MIRROR, faces),
        centre=None if muscle.centre is None else muscle.centre * MIRROR,
    )
