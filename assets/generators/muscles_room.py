# SPDX-License-Identifier: GPL-3.0-or-later
"""The soft tissue as muscles see it: how far in a place is between skin and bone."""

import numpy as np
from scipy.spatial import cKDTree

from ...sim.mesh import Mesh
from .skull_depth import BoneSpace, sampled

#: Depth, mm, taken for the whole soft tissue where a ray inward meets no bone (cheek, neck).
HOLLOW = 15.0


class Tissue:
    """Skin outside, bone and the mouth's lining inside."""

    def __init__(self, space: BoneSpace, bones: list[Mesh], skin: Mesh, inner: np.ndarray):
        self._skin = cKDTree(space.points)
        self._skin_normal = space.directions
        samples = [sampled(mesh.vertices, mesh.triangles, 1.5) for mesh in bones]
        self._bone = cKDTree(np.concatenate([p for p, _ in samples]))
        self._bone_normal = np.concatenate([n for _, n in samples])
        lining = skin.triangles[inner[skin.triangles].all(axis=1)]
        points, self._lining_normal = sampled(skin.vertices, lining, 1.5)
        self._lining = cKDTree(points)

    def foot(self, points):
        """(n, 3) place on the skin nearest to each point, and the skin's (n, 3) smooth outward direction there."""
        distance, near = self._skin.query(points, k=30)
        weight = np.exp(-(((distance - distance[:, :1]) / 2.5) ** 2))[..., None]
        normal = (weight * self._skin_normal[near]).sum(axis=1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        place = (weight * self._skin.data[near]).sum(axis=1) / weight.sum(axis=1)
        away = points - place
        height = (away * normal).sum(1, keepdims=True)
        return points - height * normal, normal

    def laid(self, lines, share):
        """Fibres (f, p, 3) laid along the skin at ``share`` (p,) of the way from skin (0) to bone (1)."""
        feet = lines
        for _ in range(4):
            feet = evened(self.foot(feet.reshape(-1, 3))[0].reshape(lines.shape), 1)
        feet, normal = self.foot(feet.reshape(-1, 3))
        deep = self.thickness(feet, normal).reshape(lines.shape[:2])
        deep = evened(deep, 2, ends=False)
        normal = evened(normal.reshape(lines.shape), 2, ends=False)
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        deep = np.clip(deep * share, 1.2, None)
        return evened(feet.reshape(lines.shape) - deep[..., None] * normal, 1)

    def thickness(self, foot, normal, lining=True):
        """(n,) mm from the skin inward to bone, or to the lining of mouth and nose."""
        steps = np.arange(1.0, 30.0, 0.75)
        ray = foot[:, None] - steps[None, :, None] * normal[:, None]
        flat = ray.reshape(-1, 3)
        hit = (self.into_bone(flat) > -0.4).reshape(ray.shape[:2])
        if lining:
            hit |= (self._lining.query(flat)[0] < 1.2).reshape(ray.shape[:2]) & (steps > 3)
        first = np.where(hit.any(axis=1), steps[hit.argmax(axis=1)], HOLLOW)
        return np.minimum(first, 26.0)

    def into_bone(self, points):
        """(n,) mm inside bone, negative outside."""
        distance, near = self._bone.query(points)
        side = ((points - self._bone.data[near]) * self._bone_normal[near]).sum(1)
        return np.where(side < 0, distance, -distance)

    def out_of_bone(self, points, clear):
        """(n, 3): points nearer than ``clear`` mm to bone, or inside it, moved out along the bone's normal."""
        for _ in range(4):
            distance, near = self._bone.query(points)
            normal = self._bone_normal[near]
            height = ((points - self._bone.data[near]) * normal).sum(1)
            push = np.where(distance < 12, np.maximum(clear - height, 0), 0)
            points = points + np.minimum(push, 4.0)[:, None] * normal
        return points

    def under_skin(self, points, clear):
        """(n, 3): points nearer than ``clear`` mm to the skin moved inward."""
        distance, near = self._skin.query(points)
        normal = self._skin_normal[near]
        height = ((self._skin.data[near] - points) * normal).sum(1)
        return points - np.maximum(clear - height, 0)[:, None] * normal

    def off_lining(self, points, clear):
        """(n, 3): points nearer than ``clear`` mm to the lining of mouth or nose moved back into the flesh."""
        distance, near = self._lining.query(points)
        normal = self._lining_normal[near]
        height = ((self._lining.data[near] - points) * normal).sum(1)
        return points - np.where(distance < 8, np.maximum(clear - height, 0), 0)[:, None] * normal


def evened(values, rounds, ends=True):
    """(f, p, ...) smoothed along the fibres and between them; ``ends``: the fibres' ends stay."""
    values = values.copy()
    for _ in range(rounds):
        middle = 0.5 * values[:, 1:-1] + 0.25 * (values[:, :-2] + values[:, 2:])
        if not ends:
            values[:, 0] = 0.6 * values[:, 0] + 0.4 * values[:, 1]
            values[:, -1] = 0.6 * values[:, -1] + 0.4 * values[:, -2]
        values[:, 1:-1] = middle
        if len(values) > 2:
            inner = slice(None) if not ends else slice(1, -1)
            values[1:-1, inner] = 0.5 * values[1:-1, inner] + 0.25 * (values[:-2, inner] + values[2:, inner])
    return values
