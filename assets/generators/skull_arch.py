# SPDX-License-Identifier: GPL-3.0-or-later
"""A dental arch as bone sees it: where the necks of the teeth stand, and the alveolar ridge that holds their roots."""

import numpy as np
from scipy.spatial import cKDTree

from .skull_depth import BoneSpace
from .skull_field import curve, join, meet
from .teeth_places import ToothPlace

#: The crest of the ridge lies this far from the necks toward the roots, mm.
CREST = 1.8
#: mm between the crest and the lining of the mouth.
LINING = 0.7
#: Least tissue over the roots, mm.
THIN = 5.0


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
        # The crest: as far from the neck as the lining of the mouth lets it come, on either side of the root.
        out = np.array([p.out * p.ll_neck / 2 for p in places])
        low = np.max([rise * space.mouth_limit(neck[:, :2] + k * out, rise, 1.8) for k in (-0.8, 0, 0.8)], axis=0)
        z = rise * np.maximum(rise * neck[:, 2] + CREST, np.minimum(low + LINING, rise * neck[:, 2] + 9.0))
        z = np.convolve(np.r_[z[0], z, z[-1]], [0.25, 0.5, 0.25], "valid")
        spot = neck + axis * ((z - neck[:, 2]) / axis[:, 2])[:, None]
        front = np.array([0.0, spot[0, 1] - 0.35, z[0]])
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
        self._tree = cKDTree(self.middle)
        self.limit_middle = float(space.mouth_limit(np.array([[4.0, self.middle[-1, 1] - 14]]), rise, 4.0)[0])

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
        out = side * (at[7] + plate_thickness(np.maximum(up, 0)) + swell) if side else np.zeros(len(length))
        plan = plan + normal * out[:, None] + lean * (self.rise * np.maximum(up, 0))[:, None]
        past = np.maximum(length - self.length[-1], 0)[:, None]
        plan = plan + past * np.array([-normal[-1][1], normal[-1][0]]) * 1.0
        return np.column_stack([plan, at[6] + self.rise * up])

    def local(self, p):
        """(n,) mm from the middle line as if the ridge stood upright, (n,) mm from the crest toward the roots' tips, and
        (n,) the station of the arch nearest in plan."""
        near = self._tree.query(p[:, :2])[1]
        tall = self.rise * (p[:, 2] - self.crest[near])
        flat = p[:, :2] - self.lean[near] * (self.rise * np.clip(tall, 0, 14))[:, None]
        distance, near = self._tree.query(flat)
        return distance, self.rise * (p[:, 2] - self.crest[near]), near

    def ridge(self, p, height: float):
        """(n,) mm, the ridge from its crest ``height`` mm toward the roots' tips."""
        distance, tall, near = self.local(p)
        ridge = distance - (self.half[near] + plate_thickness(np.maximum(tall, 0)))
        return meet(meet(ridge, -tall, 1.2), tall - height, 4)

    def on(self, bone, p, height: float):
        """``bone`` (n,) with the ridge on it: over the roots the tissue may be thinner than between the landmarks."""
        ridge = self.ridge(p, height)
        near = np.flatnonzero(ridge < 4)
        ridge[near] = meet(ridge[near], self.too_near(p[near]), 1.5)
        return join(bone, ridge, 3)

    def too_near(self, p):
        """(n,) mm, positive where the ridge would come too near to the skin or the lining of the mouth."""
        return np.maximum(THIN - self.space.depth_seen(p), 0.7 - self.space.clearance(p))


def plate_thickness(up):
    """mm of bone outside the roots ``up`` mm from the crest: thin at the rim."""
    return np.minimum(0.8 + 0.2 * up, 2.4)
