# SPDX-License-Identifier: GPL-3.0-or-later
"""The muscles of face and jaw of ``assets/tables/muscles.csv``, laid into the soft tissue of the reference head."""

import csv
from pathlib import Path

import numpy as np

from ...sim.anatomy.head import Eye, Jaw, Muscle
from ...sim.anatomy.muscle_shape import Room, muscle_shape
from ...sim.mesh import Mesh
from .muscles_points import left_points, path, point
from .muscles_room import Tissue, evened
from .skull_depth import BoneSpace
from .skull_field import curve

TABLE = Path(__file__).resolve().parents[1] / "tables" / "muscles.csv"

#: Points of a fibre, and of a ring.
POINTS, RING_POINTS = 12, 24


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
    maker = _Maker(skin, groups, space, bones, eyes[0])
    return tuple(muscle for row in rows() for muscle in maker.muscles(row))


class _Maker:
    def __init__(self, skin, groups, space, bones, eye):
        self.points = left_points(space, eye)
        self.skin, self.groups, self.eye = skin, groups, eye
        self.tissue = Tissue(space, bones, skin, np.asarray(groups["inner"]) > 0.5)
        self.room = Room(skin, bones, np.asarray(groups["inner"]) > 0.5)

    def muscles(self, row):
        """One muscle, or the left and the right one."""
        fibres, centre = self.fibres(row)
        ring = row["path"].startswith(("ring", "lids"))
        make = self._muscle(row, ring)
        if row["paired"] != "1":
            fibres = (fibres + _mirrored_middle(fibres, row)) / 2
            yield make(row["name"], fibres, centre)
            return
        yield make(row["name"] + "_l", fibres, centre)
        yield make(row["name"] + "_r", fibres * [-1, 1, 1], None if centre is None else centre * [-1, 1, 1])

    def _muscle(self, row, ring):
        width, thickness = float(row["width_mm"]), float(row["thickness_mm"])

        def make(name, fibres, centre):
            shape = muscle_shape(fibres, width, thickness, ring, self.room)
            return Muscle(name, row["kind"], fibres, width, thickness, float(row["max_shortening"]),
                          row["origin_part"], row["insertion_part"], shape, ring, centre)  # fmt: skip

        return make

    def fibres(self, row):
        """Fibres (f, p, 3) of the left or the middle muscle and the centre a sphincter pulls to (or None)."""
        text, count = row["path"], int(row["fibres"])
        if text.startswith("ring"):
            return self._orbital_ring(text, count, float(row["depth"]))
        if text.startswith("lids"):
            return self._lid_ring(text, count, float(row["depth"]))
        if text.startswith("arc"):
            return self._lip_arc(text, count)
        corners = path(text, self.points)
        deep = row["depth"].split()
        on_skin = deep[0] not in ("deep", "temple", "cheek")
        if on_skin:
            corners = self.tissue.foot(corners.reshape(-1, 3))[0].reshape(corners.shape)
        lines = np.stack([curve(side, POINTS) for side in corners])
        share = np.linspace(0, 1, count)[:, None, None]
        fibres = lines[0] * (1 - share) + lines[1] * share
        if not on_skin:
            return self._deep(fibres, row, deep[0]), None
        depth = np.interp(np.linspace(0, 1, POINTS), np.linspace(0, 1, len(deep)), [float(d) for d in deep])
        placed = self.tissue.laid(fibres, depth)
        if "m:modiolus" in text.split(">")[-1]:
            placed[:, -1] = self.points["m:modiolus"]
        return self._within(evened(placed, 2), 0.4), None

    def _deep(self, fibres, row, kind):
        """Muscles that follow bone, not skin: their paths are true in space, only kept out of the bone."""
        fibres = fibres.copy()
        if kind == "temple":  # fan on the side of the skull, narrowing to the coronoid process under the arch
            fibres = self._fan(fibres)
        clear = {"temple": 2.5, "cheek": 2.0, "deep": 0.35 * float(row["thickness_mm"])}[kind]
        for _ in range(3):
            inner = fibres[:, 1:-1]
            shape = inner.shape
            fibres[:, 1:-1] = self.tissue.out_of_bone(inner.reshape(-1, 3), clear).reshape(shape)
            fibres = evened(fibres, 2)
        return self._within(fibres, 0.3)

    def _fan(self, fibres):
        """Origins along the temporal line: an arc from beside the brow over the temple to behind the ear."""
        count = len(fibres)
        p = self.points
        front, rear = fibres[0, 0], fibres[-1, 0]
        high = (front + rear) / 2 + np.array([6.0, 0.0, 34.0])
        origin = curve(
            [front, front * 0.55 + high * 0.45 + [2, -4, 8], high, rear * 0.55 + high * 0.45 + [2, 6, 10], rear], count
        )
        gate = np.array([p["s:coronoid"] + [3.0, 0.0, 14.0], p["s:coronoid"] + [4.0, 10.0, 14.0]])
        share = np.linspace(0, 1, count)[:, None]
        gate = gate[:1] * (1 - share) + gate[1:] * share
        end = fibres[:, -1]
        out = np.stack(
            [curve([origin[k], (origin[k] + gate[k]) / 2 + [5, 0, 2], gate[k], end[k]], POINTS) for k in range(count)]
        )
        foot, normal = self.tissue.foot(out[:, 0])
        deep = 0.9 * self.tissue.thickness(foot, normal, lining=False)
        out[:, 0] = foot - deep[:, None] * normal
        return evened(out, 1, ends=False)

    def _within(self, fibres, clear):
        """Last word: out of the bone, under the skin."""
        flat = fibres.reshape(-1, 3)
        ends = np.zeros(fibres.shape[:2], bool)
        ends[:, [0, -1]] = True
        moved = flat
        for _ in range(3):
            moved = self.tissue.out_of_bone(moved, clear)
            moved = self.tissue.under_skin(self.tissue.off_lining(moved, 0.6), 1.0)
        out = moved.reshape(fibres.shape)
        same = np.linalg.norm(fibres[:, -1] - fibres[:1, -1], axis=-1).max() < 1e-9
        if same:
            out[:, -1] = out[:, -1].mean(axis=0)
        return out

    def _orbital_ring(self, text, count, depth):
        """Concentric rings about the eye: half widths to the side, above, below, from the outer to the inner ring."""
        outer, inner = (np.array([float(x) for x in part.split(",")]) for part in text[5:-1].split(";"))
        turn = 2 * np.pi * np.arange(RING_POINTS) / RING_POINTS
        c, s = np.cos(turn), np.sin(turn)
        centre = (self.points["k:en"] + self.points["k:ex"]) / 2
        lid = np.array([centre[0], 0, centre[2]])
        nose = centre[0] - 6.5
        rings = []
        for share in np.linspace(0, 1, count):
            side, above, below = outer * (1 - share) + inner * share
            x = np.where(c > 0, side * c, min(side, nose - 1.5 * share) * c)
            z = np.where(s > 0, above * s, below * s)
            rings.append(np.stack([lid[0] + x, centre[1] - 6 + np.where(c > 0, 12 * c**2, 0), lid[2] + z], axis=1))
        rings = np.array(rings)
        closed = np.concatenate([rings, rings[:, :2]], axis=1)
        placed = self.tissue.laid(closed, np.full(closed.shape[1], depth))[:, 1:-1]
        placed = np.roll(placed, 1, axis=1)
        placed = _smoothed_ring(placed, 2)
        return self._within(placed, 0.4), self.eye.centre + [0, -self.eye.radius, 0]

    def _lid_ring(self, text, count, depth):
        """Rings in the lids: from ``near`` to ``far`` mm beyond the opening, on the eyeball where lids lie on it."""
        near, far = (float(x) for x in text[5:-1].split(";"))
        en, ex, ps, pi = (self.points[f"k:{n}"] for n in ("en", "ex", "ps", "pi"))
        turn = 2 * np.pi * np.arange(RING_POINTS) / RING_POINTS
        c, s = np.cos(turn), np.sin(turn)
        middle = (en + ex) / 2
        rings = []
        for beyond in np.linspace(far, near, count):
            half = (ex[0] - en[0]) / 2 + min(beyond, 4.0)
            above, below = ps[2] - middle[2] + beyond, middle[2] - pi[2] + beyond
            x, z = middle[0] + half * c, middle[2] + np.where(s > 0, above * s, below * s)
            slope = (ex[2] - en[2]) / (ex[0] - en[0])
            radius = self.eye.radius + 1.3
            off = np.hypot(x - self.eye.centre[0], z - self.eye.centre[2])
            ball = self.eye.centre[1] - np.sqrt(np.maximum(radius**2 - off**2, 0))
            y = np.where(off < radius * 0.93, ball, np.interp(x, [en[0], ex[0]], [en[1] + 3, ex[1] + 3]))
            rings.append(np.stack([x, y, z + slope * (x - middle[0])], axis=1))
        rings = _smoothed_ring(np.array(rings), 2)
        flat = rings.reshape(-1, 3)
        for _ in range(3):
            flat = self.tissue.off_lining(self.tissue.under_skin(flat, 1.0), 0.3)
        return flat.reshape(rings.shape), self.eye.centre + [0, -self.eye.radius, 0]

    def _lip_arc(self, text, count):
        """Arcs from the right modiolus to the left one, between the red of the lip and its far edge."""
        first, last = (point(p, self.points) for p in text[4:-1].split(";"))
        end = self.points["m:modiolus"]
        corner = self.points["k:ch"]
        fibres = []
        for share in np.linspace(0, 1, count):
            middle = first * (1 - share) + last * share
            rise = middle[2] - corner[2]
            side = np.array([corner[0] * 0.5, corner[1] * 0.35 + middle[1] * 0.65, corner[2] + 0.97 * rise])
            near = corner + np.array([0.5 + 3.5 * share, 2.0, 0.62 * rise])
            left = curve([middle, side, near, end], 9)
            fibres.append(np.concatenate([left[::-1] * [-1, 1, 1], left[1:]]))
        fibres = np.array(fibres)
        placed = self.tissue.laid(fibres, np.full(fibres.shape[1], 0.55))
        placed[:, 0], placed[:, -1] = end * [-1, 1, 1], end
        placed = evened(placed, 2)
        placed = self._within((placed + placed[:, ::-1] * [-1, 1, 1]) / 2, 0.4)
        return (placed + placed[:, ::-1] * [-1, 1, 1]) / 2, self.points["k:sto"] + [0.0, 4.0, 0.0]


def _mirrored_middle(fibres, row):
    """The mirror image of a midline muscle, its fibres or its points in the matching order."""
    flipped = fibres * [-1, 1, 1]
    return flipped[:, ::-1] if row["kind"] == "sphincter" else flipped[::-1]


def _smoothed_ring(rings, rounds):
    for _ in range(rounds):
        rings = 0.5 * rings + 0.25 * (np.roll(rings, 1, axis=1) + np.roll(rings, -1, axis=1))
    return rings
