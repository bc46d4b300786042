# SPDX-License-Identifier: GPL-3.0-or-later
"""A dental arch as bone sees it: where the necks of the teeth stand, and the alveolar ridge that holds their roots."""

import numpy as np
from scipy.ndimage import gaussian_filter1d, map_coordinates, maximum_filter1d, minimum_filter1d
from scipy.spatial import cKDTree

from .skull_depth import BoneSpace
from .skull_field import curve, join, meet
from .teeth_places import ToothPlace

#: The crest of the ridge lies this far from the necks toward the roots, mm, or more where the lining wants it.
CREST = 1.6
#: mm between the ridge and the lining of the mouth: at its crest and at its walls, whose faces are large.
LINING, WALL = 1.15, 1.0
#: Least tissue over the roots, mm.
THIN = 4.0
#: mm that walls are looked for from the middle of the ridge outward, and from its crest toward the roots.
REACH, DEEP, STEP = 9.0, 16.0, 0.4
#: Every so many stations and levels of the walls are looked for; between them they run straight.
EVERY = 4


class DentalArch:
    """The left half of an alveolar ridge.

    Attributes
    ----------
    places : the eight teeth; rise : +1 upper jaw (roots point up), -1 lower
    middle : (k, 2) the middle of the ridge in plan from the midline to its end; length (k,) mm along it
    crest : (k,) z of the crest; half : (k,) half the labiolingual width of the roots there
    limit_middle : z of the roof (floor) of the mouth within the arch
    """

    def __init__(self, space: BoneSpace, places: list[ToothPlace], rise: int, count: int = 240):
        self.places, self.rise, self.space = places, rise, space
        neck = np.array([p.neck for p in places])
        axis = np.array([p.axis for p in places])
        spot = neck + axis * (CREST / np.abs(axis[:, 2:]))
        front = np.array([0.0, spot[0, 1] - 0.35, spot[0, 2]])
        step = (spot[-1] - spot[-2]) * 0.62
        self.spots = spot
        line = curve(np.concatenate([[spot[0] * [-1, 1, 1]], [front], spot, [spot[-1] + step]]), 4 * count)
        line = line[line[:, 0] >= 0]
        length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1))])
        self.length = np.linspace(0, length[-1], count)
        line = np.stack([np.interp(self.length, length, c) for c in line.T], axis=1)
        self.middle, self.crest = line[:, :2], line[:, 2]
        # Tip of the arch exactly on the midline, running square to it.
        self.middle[0, 0] = 0.0
        along = np.gradient(self.middle, axis=0)
        along[0] = [1, 0]
        self.out = np.stack([along[:, 1], -along[:, 0]], axis=1)
        self.out /= np.linalg.norm(self.out, axis=1, keepdims=True)
        self.at_tooth = self.length[cKDTree(self.middle).query(spot[:, :2])[1]]
        width = np.array([p.ll_neck / 2 for p in places])
        self.half = np.interp(self.length, self.at_tooth, width)
        # How much the roots lean, in plan, per mm of height.
        lean = axis[:, :2] / axis[:, 2:]
        self.lean = np.stack([np.interp(self.length, self.at_tooth, c) for c in lean.T], axis=1)
        self.lean[0, 0] = 0.0
        sunk = self._sunk()
        self.middle = self.middle + self.lean * (rise * sunk)[:, None]
        self.crest = self.crest + rise * sunk
        self.spots = spot + axis * (np.interp(self.at_tooth, self.length, sunk) / np.abs(axis[:, 2]))[:, None]
        self._levels = np.arange(0, DEEP + STEP, STEP)
        self._walls = {side: self._room(side) for side in (1, -1)}
        self._tree = cKDTree(self.middle)
        self.limit_middle = float(space.mouth_limit(np.array([[4.0, self.middle[-1, 1] - 14]]), rise, 4.0)[0])

    def _rays(self, up, out, every=1):
        """(240 / every, u, t, 3) mm: points ``up`` (u,) from the crest to the roots and ``out`` (t,) from the middle line."""
        k = slice(None, None, every)
        down = self.lean[k, None, None] * (self.rise * up)[:, None, None]
        plan = self.middle[k, None, None] + down + self.out[k, None, None] * out[:, None]
        height = self.crest[k, None, None] + (self.rise * up)[:, None] + 0 * out
        return np.concatenate([plan, height[..., None]], axis=-1)

    def _sunk(self):
        """(240,) mm by which the crest has to stay back from its first place to lie under the lining."""
        up = np.arange(0, 9.0, STEP)
        free = np.ones((len(self.length), len(up)), bool)
        for share in (-0.8, 0.0, 0.8):
            at = self._rays(up, np.zeros(1))[:, :, 0]
            at[..., :2] += (share * self.half)[:, None, None] * self.out[:, None]
            free &= self.space.mouth.depth(at.reshape(-1, 3), 2.0).reshape(free.shape) > LINING
        first = up[np.where(free.any(axis=1), free.argmax(axis=1), len(up) - 1)]
        return _even(maximum_filter1d(first, 15, mode="nearest"), 6.0)

    def _room(self, side):
        """(240, u) mm from the middle line to the wall on one side, at the levels kept: as thick as lining and skin allow."""
        out, levels = np.arange(0, REACH, STEP), self._levels[::2]
        at = self._rays(levels, side * out, EVERY)
        flat, shape = at.reshape(-1, 3), at.shape[:3]
        shut = (self.space.mouth.depth(flat, 2.0) < WALL) | (self.space.depth_seen(flat) < THIN)
        shut = shut.reshape(shape)
        free = np.where(shut.any(axis=2), out[shut.argmax(axis=2)] - STEP / 2, REACH)
        row, level = np.arange(len(self.length)) / EVERY, np.arange(len(self._levels)) / 2
        free = map_coordinates(free, np.meshgrid(row, level, indexing="ij"), order=1, mode="nearest")
        free = _even(minimum_filter1d(free, 9, axis=0, mode="nearest"), 3.0)
        free = gaussian_filter1d(free, 1.0, axis=1, mode="nearest")
        wanted = self.half[:, None] + plate_thickness(self._levels)
        return np.maximum(np.minimum(wanted, free), 0.8)

    def stand(self, length, side, up):
        """(k,) mm from the middle line to the wall on a side (+1 outer, -1 inner), ``up`` mm from the crest."""
        row = np.interp(length, self.length, np.arange(len(self.length)))
        level = np.clip(np.broadcast_to(up, row.shape), 0, DEEP) / STEP
        return map_coordinates(self._walls[side], [row, level], order=1, mode="nearest")

    def along(self, length, out, up):
        """(k, 3) points ``out`` mm outside the roots and ``up`` mm from the crest toward the root, at ``length`` (k,)."""
        at = [np.interp(length, self.length, c) for c in (*self.middle.T, self.crest, self.half)]
        normal = np.stack([np.interp(length, self.length, c) for c in self.out.T], axis=1)
        plan = np.stack(at[:2], axis=1) + normal * (at[3] + out)[:, None]
        return np.column_stack([plan, at[2] + self.rise * up])

    def off(self, xy):
        """(n,) mm how far outside the middle line of the arch a place lies in plan, negative within."""
        distance, near = self._tree.query(xy)
        side = ((xy - self.middle[near]) * self.out[near]).sum(axis=1)
        return np.where(side > 0, distance, -distance)

    def wall(self, length, side, up, swell):
        """(k, 3) points of the ridge's wall ``up`` mm from the crest: ``side`` +1 outer, -1 inner, 0 the middle line.

        swell : mm that the wall stands out there
        """
        length, up = np.asarray(length, float), np.broadcast_to(np.asarray(up, float), np.shape(length))
        at = [
            np.interp(length, self.length, c)
            for c in (*self.middle.T, *self.out.T, *self.lean.T, self.crest, self.half)
        ]
        plan, normal, lean = (np.stack(at[k : k + 2], axis=1) for k in (0, 2, 4))
        out = side * (self.stand(length, side, up) + swell) if side else np.zeros(len(length))
        plan = plan + normal * out[:, None] + lean * (self.rise * np.maximum(up, 0))[:, None]
        past = np.maximum(length - self.length[-1], 0)[:, None]
        plan = plan + past * np.array([-normal[-1][1], normal[-1][0]]) * 1.0
        return np.column_stack([plan, at[6] + self.rise * up])

    def local(self, p):
        """(n,) mm outward from the middle line as if the ridge stood upright, (n,) mm from the crest toward the roots' tips,
        and (n,) the station of the arch nearest in plan."""
        near = self._tree.query(p[:, :2])[1]
        tall = self.rise * (p[:, 2] - self.crest[near])
        flat = p[:, :2] - self.lean[near] * (self.rise * np.clip(tall, 0, DEEP))[:, None]
        distance, near = self._tree.query(flat)
        side = ((flat - self.middle[near]) * self.out[near]).sum(axis=1)
        return np.where(side > 0, distance, -distance), self.rise * (p[:, 2] - self.crest[near]), near

    def ridge(self, p, height: float):
        """(n,) mm, the ridge from its crest ``height`` mm toward the roots' tips."""
        away, tall, near = self.local(p)
        side = np.where(away > 0, 1, -1)
        wall = np.where(side > 0, *(self.stand(self.length[near], k, tall) for k in (1, -1)))
        return meet(meet(np.abs(away) - wall, -tall, 1.2), tall - height, 4)

    def on(self, bone, p, height: float):
        """``bone`` (n,) with the ridge on it: over the roots the tissue may be thinner than between the landmarks."""
        return join(bone, self.ridge(p, height), 1.5)


def _even(values, sigma):
    """Values (240, ...) along the arch smoothed, as if its mirror image went before."""
    whole = np.concatenate([values[:0:-1], values])
    return gaussian_filter1d(whole, sigma, axis=0, mode="nearest")[len(values) - 1 :]


def plate_thickness(up):
    """mm of bone outside the roots ``up`` mm from the crest: thin at the rim."""
    return np.minimum(0.8 + 0.2 * up, 2.4)
