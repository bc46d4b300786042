# SPDX-License-Identifier: GPL-3.0-or-later
"""A pinhole camera (or projector) and the depth map it sees of a triangle mesh."""

from dataclasses import dataclass

import numpy as np

#: Triangle-pixel pairs examined at once: bounds the memory.
BATCH = 2_000_000


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A pinhole at ``centre`` (3,) mm looking along ``axes[2]``; ``axes`` (3, 3) rows: right, down, forward.

    focal : pixels; width, height : pixels. The optical axis goes through the middle of the image.
    """

    centre: np.ndarray
    axes: np.ndarray
    focal: float
    width: int
    height: int

    @classmethod
    def around(cls, target, yaw, pitch, distance, pixel, width, height) -> "Viewpoint":
        """Looking at ``target`` (3,) from ``distance`` mm; ``yaw`` rad toward the subject's left, ``pitch`` rad up.

        pixel : mm that one pixel covers at the target; width, height : mm of the field there.
        """
        target = np.asarray(target, dtype=float)
        toward = np.array([np.sin(yaw) * np.cos(pitch), -np.cos(yaw) * np.cos(pitch), np.sin(pitch)])
        right = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        axes = np.stack([right, np.cross(-toward, right), -toward])
        return cls(target + distance * toward, axes, distance / pixel, int(width / pixel), int(height / pixel))

    def project(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) pixel x, pixel y (pixel centres at half numbers) and depth in mm along the axis."""
        local = (points - self.centre) @ self.axes.T
        with np.errstate(divide="ignore", invalid="ignore"):
            image = local[:, :2] / local[:, 2:] * self.focal
        return np.column_stack([image + [self.width / 2, self.height / 2], local[:, 2]])

    def points(self, x: np.ndarray, y: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """(n, 3) mm: what `project` maps to these pixel coordinates and depths."""
        local = np.column_stack(
            [(x - self.width / 2) / self.focal, (y - self.height / 2) / self.focal, np.ones_like(x)]
        )
        return self.centre + (local * np.asarray(depth)[:, None]) @ self.axes


@dataclass(frozen=True, eq=False)
class DepthMap:
    """What a viewpoint sees, per pixel.

    depth : (h, w) mm along the optical axis, inf where nothing is
    triangle : (h, w) int32, -1 where nothing is
    weights : (h, w, 3) barycentric coordinates in that triangle
    """

    depth: np.ndarray
    triangle: np.ndarray
    weights: np.ndarray

    def sample(self, values: np.ndarray, triangles: np.ndarray, where: np.ndarray) -> np.ndarray:
        """Vertex ``values`` (n, ...) interpolated at the pixels ``where`` (h, w) bool."""
        corner = values[triangles[self.triangle[where]]]
        weights = self.weights[where]
        return np.einsum("ij,ij...->i...", weights, corner)


def depth_map(view: Viewpoint, vertices: np.ndarray, triangles: np.ndarray) -> DepthMap:
    """Nearest surface through each pixel centre, of both sides of the triangles; exact for flat triangles."""
    w, h = view.width, view.height
    image = view.project(vertices)
    corner = image[triangles]
    first, second, third = corner[:, 0], corner[:, 1], corner[:, 2]
    low = np.minimum(np.minimum(first, second), third)  # (t, 3): a reduction over three is slow
    high = np.maximum(np.maximum(first, second), third)
    front = low[:, 2] > 1.0
    low[~front], high[~front] = np.inf, -np.inf
    low = np.clip(np.ceil(low[:, :2] - 0.5), 0, [w, h]).astype(np.int64)
    high = np.clip(np.floor(high[:, :2] - 0.5), -1, [w - 1, h - 1]).astype(np.int64)
    e1, e2 = second[:, :2] - first[:, :2], third[:, :2] - first[:, :2]
    det = e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]
    size = high - low + 1
    use = np.flatnonzero((size[:, 0] > 0) & (size[:, 1] > 0) & (np.abs(det) > 1e-12))
    pairs = size[use, 0] * size[use, 1]
    nearness = np.zeros(w * h)  # 1 / depth: linear over the image of a flat triangle
    which = np.full(w * h, -1, dtype=np.int32)
    weights = np.zeros((w * h, 3))
    total = np.cumsum(pairs)
    start = 0
    while start < len(use):
        stop = max(start + 1, int(np.searchsorted(total, (total[start - 1] if start else 0) + BATCH, side="right")))
        _rasterise(use[start:stop], pairs[start:stop], low, high, corner, e1, e2, det, w, nearness, which, weights)
        start = stop
    with np.errstate(divide="ignore"):
        depth = 1 / nearness
    return DepthMap(depth.reshape(h, w), which.reshape(h, w), weights.reshape(h, w, 3))


def _rasterise(use, pairs, low, high, corner, e1, e2, det, w, nearness, which, weights):
    of = np.repeat(use, pairs)
    step = np.arange(len(of)) - np.repeat(np.cumsum(pairs) - pairs, pairs)
    span = (high - low + 1)[of, 0]
    x, y = low[of, 0] + step % span, low[of, 1] + step // span
    dx, dy = x + 0.5 - corner[of, 0, 0], y + 0.5 - corner[of, 0, 1]
    v = (dx * e2[of, 1] - dy * e2[of, 0]) / det[of]
    t = (e1[of, 0] * dy - e1[of, 1] * dx) / det[of]
    inside = (v >= -1e-9) & (t >= -1e-9) & (v + t <= 1 + 1e-9)
    of, v, t, pixel = of[inside], v[inside], t[inside], (y * w + x)[inside]
    inverse = np.stack([1 - v - t, v, t], axis=1) / corner[of, :, 2]
    near = inverse.sum(axis=1)
    order = np.argsort(near, kind="stable")  # the nearest is written last and stays
    order = order[near[order] > nearness[pixel[order]]]
    pixel, near = pixel[order], near[order]
    nearness[pixel] = near
    which[pixel] = of[order]
    weights[pixel] = inverse[order] / near[:, None]
