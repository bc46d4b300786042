# SPDX-License-Identifier: GPL-3.0-or-later
"""Lips and cheeks against the teeth: each dental arch as a wall round a vertical axis behind it.

The wall's radius over angle and height is read off the teeth once. A wall is robust where single teeth are not: a lip
that was in front of the arch is pushed to the front again however deep it got, and no vertex catches on an edge.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter

from ..anatomy.head import Head
from ..anatomy.teeth import crowns
from ..angles import bearing
from .layers import Layers
from .planes import Planes, empty_planes

_ANGLES, _HEIGHTS = 96, 16
_CLEARANCE = 0.25
#: mm by which the wall draws back for each mm past the biting edge.
_DRAW = 1.5
#: mm away for each mm over the wall, as it draws back; mm that what has no teeth behind it is away from them, at least.
_LEAST, BESIDE = 0.5, 0.5


@dataclass(frozen=True, eq=False)
class Arch:
    """One row of teeth. centre (2,) mm: x, y of the axis; bottom, top mm; radius (a, h) over angle from the front
    (-pi..pi) and height, 0 where there are no teeth; column (c,) skin columns in front of it, clearance (c,) mm;
    lower: it moves with the mandible."""

    centre: np.ndarray
    bottom: float
    top: float
    radius: np.ndarray
    column: np.ndarray
    clearance: np.ndarray
    lower: bool

    def coordinates(self, points):
        """Angle (k,), distance from the axis (k,) and unit radial direction (k, 3)."""
        rel = points[:, :2] - self.centre
        far = np.maximum(np.hypot(rel[:, 0], rel[:, 1]), 1e-6)
        radial = np.concatenate([rel / far[:, None], np.zeros((len(rel), 1))], axis=1)
        return bearing(rel[:, 0], -rel[:, 1]), far, radial

    def before(self, points):
        """mm from the axis (k,) of ``points`` (k, 3), and the wall there."""
        angle, far, _ = self.coordinates(points)
        return far, self.wall(angle, points[:, 2])[0]

    def crest(self, points):
        """(k,) mm: the wall's largest radius at any height, in the direction of ``points`` (k, 3)."""
        angle = self.coordinates(points)[0]
        return self.radius.max(axis=1)[np.floor((angle + np.pi) / (2 * np.pi) * _ANGLES).astype(int) % _ANGLES]

    def wall(self, angle, height):
        """Radius of the wall (k,), its slope over the angle and over the height.

        The gum goes on behind the row; past the biting edge the wall draws back, so that a lip may slip under it.
        """
        span = self.top - self.bottom
        a = (angle + np.pi) / (2 * np.pi) * _ANGLES - 0.5
        z = np.clip((height - self.bottom) / span * (_HEIGHTS - 1), 0, _HEIGHTS - 1.001)
        i, j = np.floor(a).astype(int), np.floor(z).astype(int)
        u, v = a - i, z - j
        i, k = i % _ANGLES, (i + 1) % _ANGLES
        r = self.radius
        low, high = r[i, j] * (1 - u) + r[k, j] * u, r[i, j + 1] * (1 - u) + r[k, j + 1] * u
        over_angle = ((r[k, j] - r[i, j]) * (1 - v) + (r[k, j + 1] - r[i, j + 1]) * v) * _ANGLES / (2 * np.pi)
        over_height = (high - low) * (_HEIGHTS - 1) / span
        past = np.maximum(height - self.top, 0) if self.lower else np.maximum(self.bottom - height, 0)
        beyond = (height < self.bottom) | (height > self.top)
        over_height = np.where(past > 0, -_DRAW if self.lower else _DRAW, np.where(beyond, 0.0, over_height))
        wall = low * (1 - v) + high * v
        return np.where(wall > 0.6 * r.max(), np.maximum(wall - _DRAW * past, 0), 0.0), over_angle, over_height


def build_arches(head: Head, layers: Layers) -> tuple[Arch, ...]:
    """The walls of both rows of teeth."""
    n = len(layers.area)
    zero = np.zeros(n)
    near_mouth = np.zeros(n, bool)
    for name in ("lip_upper", "lip_lower", "mouth_bag"):
        near_mouth |= np.asarray(head.groups.get(name, zero)) > 0.05
    near_mouth &= layers.free[:n]
    arches = []
    for part in ("teeth_upper", "teeth_lower"):
        mesh = head.parts.get(part)
        if mesh is None or len(mesh.vertices) < 50:
            continue
        # roots stand in bone: only what is in the mouth holds lips and cheeks off
        tri = mesh.vertices[mesh.triangles[crowns(mesh)[mesh.triangles].all(axis=1)]]
        weights = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [1 / 3] * 3])
        points = np.einsum("sk,tkj->tsj", weights, tri).reshape(-1, 3)
        low, high = points.min(axis=0), points.max(axis=0)
        centre = np.array([(low[0] + high[0]) / 2, low[1] + 0.75 * (high[1] - low[1])])
        arch = Arch(
            centre, low[2], high[2], np.zeros((_ANGLES, _HEIGHTS)), np.zeros(0, int), np.zeros(0), "lower" in part
        )
        angle, far, _ = arch.coordinates(points)
        i = np.floor((angle + np.pi) / (2 * np.pi) * _ANGLES).astype(int) % _ANGLES
        j = np.clip(np.rint((points[:, 2] - low[2]) / (high[2] - low[2]) * (_HEIGHTS - 1)).astype(int), 0, _HEIGHTS - 1)
        np.maximum.at(arch.radius, (i, j), far)
        # close the gaps between teeth and rows of points, then even out; angles wrap round
        closed = minimum_filter(
            maximum_filter(arch.radius, (5, 3), mode=("wrap", "nearest")), (3, 1), mode=("wrap", "nearest")
        )
        arch.radius[:] = gaussian_filter(closed, (1.0, 0.7), mode=("wrap", "nearest"))
        # what narrows to the gum or to a pointed edge keeps at least most of the row's radius
        crest = arch.radius.max(axis=1, keepdims=True)
        arch.radius[:] = np.where(crest > 0, np.maximum(arch.radius, crest - 3.0), 0.0)
        column = np.flatnonzero(near_mouth & (np.linalg.norm(head.skin.vertices[:, :2] - centre, axis=1) < 75))
        skin = head.skin.vertices[column]
        # at any height: what stands in front of the row where it is highest is in front of it
        far, wall = arch.before(skin)
        ahead = arch.crest(skin)
        in_front = (ahead > 0.6 * arch.radius.max()) & (far > ahead - 1.5)
        clearance = np.minimum(far - np.where(wall > 0, wall, ahead), _CLEARANCE)
        arches.append(
            Arch(centre, low[2], high[2], arch.radius, column[in_front], clearance[in_front], "lower" in part)
        )
    return tuple(arches)


def arch_contacts(surfaces, positions, rotation, translation) -> Planes:
    """Planes that keep lips, cheeks and mouth bag in front of the teeth; the lower row moves with the mandible."""
    node, normal, level = [], [], []
    for arch in surfaces.arches:
        keep, n, missing = wall_planes(arch, positions[arch.column], arch.clearance, rotation, translation)
        node.append(arch.column[keep])
        normal.append(n)
        level.append(np.einsum("ij,ij->i", positions[arch.column[keep]], n) + missing)
    if not node:
        return empty_planes()
    node, normal, level = (np.concatenate(x) for x in (node, normal, level))
    return Planes(node, normal, level, np.full(len(node), -1))


def wall_planes(arch: Arch, points, clearance, rotation, translation, reach: float = 4.0, nearby=None):
    """The wall as tangent planes before ``points`` (k, 3): rows (c,) of those nearer than ``reach`` mm or behind it,
    normals (c, 3) and mm (c,) by which each is to go on along its normal to keep its ``clearance`` (k,) mm.

    nearby : `Nearby`, if far points are to be looked at more seldom
    """
    if arch.lower:
        points = (points - translation) @ rotation
    keep = np.arange(len(points)) if nearby is None else nearby.due(arch, points)
    angle, far, radial = arch.coordinates(points[keep])
    wall, over_angle, over_height = arch.wall(angle, points[keep, 2])
    if nearby is not None:
        nearby.seen(arch, keep, points, np.where(wall > 0, _LEAST * (far - wall - reach), BESIDE))
    near = np.flatnonzero((wall > 0) & (far < wall + reach))
    keep, angle, far, radial, wall = keep[near], angle[near], far[near], radial[near], wall[near]
    tangent = np.stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))], axis=1)
    slope = np.clip(over_angle[near] / np.maximum(far, 1.0), -0.7, 0.7)
    rise = np.clip(over_height[near], -0.7, 0.7)
    n = radial - slope[:, None] * tangent - rise[:, None] * [0.0, 0, 1]
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    missing = (wall + clearance[keep] - far) * np.einsum("ij,ij->i", n, radial)
    return keep, n @ rotation.T if arch.lower else n, missing
