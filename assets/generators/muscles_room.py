# SPDX-License-Identifier: GPL-3.0-or-later
"""The soft tissue as muscles are painted into it: the place on the skin, and how deep it is to bone there."""

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from ...sim.anatomy.muscle_room import Room, Samples, both_ways
from ...sim.mesh import Mesh
from .skull_depth import _without_ears

#: Depth, mm, taken for the whole soft tissue where a ray inward meets no bone (cheek, neck).
HOLLOW = 14.0


class Tissue:
    """Skin outside, without its ears; bone and the mouth's lining inside."""

    def __init__(self, room: Room, skin: Mesh, groups: dict[str, np.ndarray]):
        inner = np.asarray(groups["inner"]) > 0.5
        smooth = _without_ears(skin, np.asarray(groups["ear_l"], float) + np.asarray(groups["ear_r"], float))
        triangles = both_ways(skin.faces)
        self._skin = Samples(smooth, triangles[~inner[triangles].any(axis=1)])
        self._room = room

    def foot(self, points):
        """(n, 3) place on the skin under which each point lies, and the skin's (n, 3) smooth outward direction."""
        normal = self._skin.smooth_normal(points, 40)
        height, out, _ = self._skin.height(points)
        return points - height[:, None] * out, normal

    def front(self, points):
        """(n, 3) the place on the skin of the face straight before or behind each point."""
        facing = (self._skin.normals[:, 1] < -0.1) & (self._skin.points[:, 1] < -20)
        plane = [0, 2]
        tree = cKDTree(self._skin.points[facing][:, plane])
        near = tree.query(points[:, plane], k=4)[1]
        out = points.copy()
        out[:, 1] = self._skin.points[facing][near, 1].mean(axis=1)
        return out

    def lower_end(self) -> dict[str, np.ndarray]:
        """``b:front`` and ``b:side``, (3,) mm: beside the middle and far out, just above the rim of bust or neck."""
        front = self._skin.points[self._skin.normals[:, 1] < -0.2]
        front = front[front[:, 2] < front[:, 2].min() + 60]
        out = {}
        for name, x, above in (("b:front", 15.0, 28.0), ("b:side", 0.76 * front[:, 0].max(), 20.0)):
            strip = front[np.abs(front[:, 0] - x) < 5]
            height = strip[:, 2].min() + above
            out[name] = strip[np.linalg.norm(strip[:, [0, 2]] - [x, height], axis=1).argmin()]
        return out

    def painted(self, lines):
        """Fibres (f, p, 3) moved onto the skin, the outward directions (f, p, 3) and the mm (f, p) of tissue there."""
        shape = lines.shape
        for _ in range(3):
            lines = self.foot(lines.reshape(-1, 3))[0].reshape(shape)
            lines = evened(lines, 1)
        feet, normal = self.foot(lines.reshape(-1, 3))
        normal = evened(normal.reshape(shape), 5, ends=False)
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        deep = self.thickness(feet, normal.reshape(-1, 3)).reshape(shape[:2])
        return feet.reshape(shape), normal, evened(deep, 4, ends=False)

    def level(self, feet):
        """Level outward directions (f, p, 3) of the skin at ``feet`` (f, p, 3), and the mm (f, p) of tissue there.

        A lip's skin turns inward at its edge, what lies in the lip does not.
        """
        normal = self._skin.smooth_normal(feet.reshape(-1, 3), 40).reshape(feet.shape) * [1, 1, 0]
        normal = evened(normal, 6, ends=False)
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        deep = self.thickness(feet.reshape(-1, 3), normal.reshape(-1, 3)).reshape(feet.shape[:2])
        return normal, evened(deep, 4, ends=False)

    def thickness(self, foot, normal):
        """(n,) mm from the skin inward to bone, or to the lining of mouth and nose."""
        steps = np.arange(1.0, 30.0, 0.75)
        ray = foot[:, None] - steps[None, :, None] * normal[:, None]
        flat = ray.reshape(-1, 3)
        height = np.min([bone.about(flat) for bone in self._room.bones], axis=0).reshape(ray.shape[:2])
        hit = height < 0.0
        hit |= self._room.near_lining(flat, 1.2).reshape(ray.shape[:2]) & (steps > 2)
        first = hit.argmax(axis=1)
        row = np.arange(len(foot))
        before = np.maximum(height[row, np.maximum(first - 1, 0)], 0)  # from the last step outside, as far as is left
        found = np.where(first > 0, steps[np.maximum(first - 1, 0)] + np.minimum(before, 0.75), steps[0])
        return np.where(hit.any(axis=1), found, HOLLOW)


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


def calmed(fibres, rows: int, columns: int = 3, ends: float = 6.0):
    """Fibres (f, p, 3) as the spline surface of ``rows`` by ``columns`` controls nearest to them.

    ``ends``: how much more the first and the last point of a fibre weigh than one between.
    """
    f, p = fibres.shape[:2]
    along, across = _splines(p, min(rows, p)), _splines(f, min(columns, f), degree=2)
    weight = np.ones(p)
    weight[[0, -1]] = ends
    control = np.linalg.lstsq(weight[:, None] * along, (weight[:, None] * fibres.transpose(1, 0, 2).reshape(p, -1)),
                              rcond=None)[0]  # fmt: skip
    fibres = (along @ control).reshape(p, f, 3).transpose(1, 0, 2)
    control = np.linalg.lstsq(across, fibres.reshape(f, -1), rcond=None)[0]
    return (across @ control).reshape(fibres.shape)


def _splines(count, controls, degree=3):
    """(count, controls) B-splines of a clamped even knot vector, at even places."""
    degree = min(degree, controls - 1)
    if degree < 1:
        return np.ones((count, 1))
    inside = np.linspace(0, 1, controls - degree + 1)
    knots = np.concatenate([np.zeros(degree), inside, np.ones(degree)])
    return BSpline.design_matrix(np.linspace(0, 1, count), knots, degree).toarray()
