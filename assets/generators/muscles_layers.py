# SPDX-License-Identifier: GPL-3.0-or-later
"""Muscles in layers: each slides over those that lie deeper, and all keep off bone, skin and the mouth's lining."""

import numpy as np
from scipy.spatial import cKDTree

from ...sim.anatomy.muscle_room import SKIN_CLEAR, Room, Samples
from ...sim.anatomy.muscle_shape import frames, muscle_sheet
from ...sim.mesh import Mesh
from .muscles_room import evened

#: mm left between two layers; how far beside a point a deeper muscle still counts as under it.
GAP, BESIDE = 0.15, 1.5
#: mm from a shared node within which muscles may grow into each other.
MERGE = 7.0


class Layers:
    """The muscles laid so far, deepest first, on both sides of the head."""

    def __init__(self, room: Room):
        self.room = room
        self._laid: list[tuple] = []

    def add(self, level: float, shape: Mesh, paired: bool) -> None:
        """Let ``shape`` count as laid at ``level`` (0 is deepest), its mirror image too."""
        points = Samples(shape.vertices, shape.triangles).points
        for side in (points, points * [-1, 1, 1])[: 1 + paired]:
            self._laid.append((level, side, side.min(axis=0), side.max(axis=0)))

    def lift(self, points, normals, level) -> np.ndarray:
        """(n,) mm each point (n, 3) must rise along its normal to clear what is deeper; at most 0 where it is clear."""
        low, high = points.min(axis=0) - 9, points.max(axis=0) + 9
        deeper = [s for at, s, a, b in self._laid if at < level and (a < high).all() and (b > low).all()]
        deeper = [s[((s > low) & (s < high)).all(axis=1)] for s in deeper]
        out = np.full(len(points), -np.inf)
        if not sum(map(len, deeper)):
            return out
        deeper = np.concatenate(deeper)
        tree = cKDTree(deeper)
        # along the line through each point: the samples beside it
        for step in np.arange(-7.0, 8.1, 1.5):
            far, near = tree.query(points + step * normals, distance_upper_bound=1.2 * BESIDE)
            found = np.flatnonzero(np.isfinite(far))
            away = deeper[near[found]] - points[found]
            above = np.einsum("nj,nj->n", away, normals[found])
            beside = (away**2).sum(1) - above**2
            above = np.where(beside < BESIDE**2, above, -np.inf)
            out[found] = np.maximum(out[found], above)
        return out

    def settled(self, fibres, half, level, keep, clear, ring=False, rounds=11):
        """Fibres (f, p, 3) kept off bone, lining, skin and deeper muscles, half (f, p) mm of muscle to either side.

        keep : (f, p) 0..1, how much a point must clear deeper muscles; at 0 it is a shared node, which stays. clear :
        (f, p) mm to keep from bone.
        """
        shape = fibres.shape
        held, node = fibres.copy(), (keep <= 0)[..., None]
        for k in range(rounds):
            if k < rounds - 2:
                fibres = _smooth(fibres, ring)
            if k in (1, 4, 8):
                fibres = fibres + keep[..., None] * self._rise(fibres, half, level, ring)
            flat = fibres.reshape(-1, 3)
            for bone, *_ in self.room.bones:
                height, normal, _ = bone.height(flat, 12.0)
                flat = flat + np.clip(clear.ravel() - height, 0, 4.0)[:, None] * normal
            for lining in self.room.linings[:1]:
                height, normal, far = lining.height(flat, 8.0)
                need = np.where(np.isfinite(far), np.clip(height + 0.3 + 0.8 * half.ravel(), 0, 3.0), 0)
                flat = flat - need[:, None] * normal
            height, normal, far = self.room.skin.height(flat, 8.0)
            need = np.where(np.isfinite(far), np.maximum(height + SKIN_CLEAR + half.ravel(), 0), 0)
            flat = flat - need[:, None] * normal
            fibres = np.where(node, held, flat.reshape(shape))
        return fibres

    def _rise(self, fibres, half, level, ring):
        """(f, p, 3) mm to move, so that the sheet spans what lies deeper as a taut cloth would."""
        sheet = muscle_sheet(fibres, ring)
        normal = frames(sheet, ring, self.room)[2]
        lift = self.lift(sheet.reshape(-1, 3), normal.reshape(-1, 3), level).reshape(sheet.shape[:2])
        lift = np.maximum(_widest(lift, ring)[::2, ::2] + GAP + half, 0)
        lift = np.where(np.isfinite(lift), lift, 0)
        place, way = fibres.reshape(-1, 3), normal[::2, ::2]
        room = np.maximum(-self.room.skin.height(place)[0].reshape(half.shape) - SKIN_CLEAR - half, 0)
        lift = np.minimum(lift, room)
        slack = lift
        for _ in range(4):
            slack = np.maximum(lift, 0.98 * evened(slack[..., None], 1, ends=False)[..., 0])
        return np.minimum(slack, room)[..., None] * way

    def undercut(self, shape: Mesh, columns: int, stations: int, level, keep, least=0.12) -> Mesh:
        """``shape`` hollowed below so that it lies on the muscles under it; ``keep`` (s,) 0..1 per station fades that.

        The vertices are those of `muscle_shape`: stations of ``columns`` above and ``columns - 2`` below.
        """
        rings = shape.vertices.reshape(stations, 2 * columns - 2, 3).copy()
        top = rings[:, 1 : columns - 1]
        low = rings[:, columns:][:, ::-1]
        across = top - low
        thick = np.maximum(np.linalg.norm(across, axis=2, keepdims=True), 1e-9)
        way = across / thick
        thick = thick[..., 0]
        lift = self.lift(low.reshape(-1, 3), way.reshape(-1, 3), level).reshape(thick.shape)
        lift = np.where(np.isfinite(lift), np.maximum(lift + 0.05, 0), 0) * keep[:, None]
        share = np.minimum(lift, np.maximum(thick - least, 0))
        low = low + share[..., None] * way
        over = np.minimum(lift - share, 1.5)
        rings[:, 1 : columns - 1] = top + over[..., None] * way
        rings[:, columns:] = (low + over[..., None] * way)[:, ::-1]
        return shape.moved(rings.reshape(-1, 3))


def _widest(values, ring):
    """The largest of each value and its eight neighbours."""
    edge = {"mode": "edge"}
    padded = np.pad(values, ((1, 1), (0, 0)), **edge)
    values = np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:])
    padded = np.pad(values, ((0, 0), (1, 1)), mode="wrap" if ring else "edge")
    return np.maximum(np.maximum(padded[:, :-2], padded[:, 1:-1]), padded[:, 2:])


def _smooth(fibres, ring):
    if not ring:
        return 0.6 * fibres + 0.4 * evened(fibres, 1)
    return 0.7 * fibres + 0.15 * (np.roll(fibres, 1, axis=1) + np.roll(fibres, -1, axis=1))
