# SPDX-License-Identifier: GPL-3.0-or-later
"""The soft tissue as muscles see it: how far in a place is between skin and bone."""

import numpy as np
from scipy.spatial import cKDTree

from ...sim.mesh import Mesh
from .skull_depth import BoneSpace, _sampled

#: Depth, mm, taken for the whole soft tissue where a ray inward meets no bone (cheek, neck).
HOLLOW = 15.0


class Tissue:
    """Skin outside, bone and the mouth's lining inside."""

    def __init__(self, space: BoneSpace, bones: list[Mesh], skin: Mesh, inner: np.ndarray):
        self._skin = cKDTree(space.points)
        self._skin_normal = space.directions
        samples = [_sampled(mesh.vertices, mesh.triangles, 1.5) for mesh in bones]
        self._bone = cKDTree(np.concatenate([p for p, _ in samples]))
        self._bone_normal = np.concatenate([n for _, n in samples])
        lining = skin.triangles[inner[skin.triangles].all(axis=1)]
        self._lining = cKDTree(_sampled(skin.vertices, lining, 1.5)[0])

    def foot(self, points):
        """(n, 3) place on the skin over each point, and the skin's (n, 3) smooth outward direction there."""
        distance, near = self._skin.query(points, k=14)
        weight = np.exp(-(((distance - distance[:, :1]) / 3.0) ** 2))[..., None]
        normal = (weight * self._skin_normal[near]).sum(axis=1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        closest = self._skin.data[near[:, 0]]
        # Stay over the point: slide along the skin's tangent plane.
        away = points - closest
        return points - (away * normal).sum(1, keepdims=True) * normal, normal

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

    def at_depth(self, points, share):
        """(n, 3): each point moved along the skin's normal to a ``share`` of the way from skin (0) to bone (1)."""
        foot, normal = self.foot(points)
        deep = np.clip(share * self.thickness(foot, normal), 1.2, None)
        return foot - deep[:, None] * normal

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
