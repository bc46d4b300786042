# SPDX-License-Identifier: GPL-3.0-or-later
"""How far the scan lies above or below the drawn skin, texel by texel, and how far to believe it."""

import numpy as np

from ..adapt.closest import Surface
from ..progress import Progress, Work
from .chart import Chart, Texels

BLOCK = 20_000  # texels measured between two steps of progress
REACH = 3.0  # mm: data farther than this is something else, hair or the other lip
SURE = 1.5  # mm: data nearer than this counts fully
AGREE = 0.5  # cosine: the data must face the way the skin does
LIFT = 0.3  # mm, the most that curvature may raise the scan between its vertices
WHOLE = 150.0  # mm²: a piece of data smaller than this is trusted in proportion


def heights(chart: Chart, texels: Texels, target: Surface, trusted: np.ndarray) -> Work:
    """Work returning height (k,) mm of the scan ``target`` over the texels, along the normal, and trust (k,) 0..1.

    trusted (n,) 0..1 : how far each vertex of the chart may be displaced at all
    """
    settle = settling(target)
    count = len(texels.index)
    height, trust = np.zeros(count, dtype=np.float32), np.zeros(count, dtype=np.float32)
    for start in range(0, count, BLOCK):
        yield Progress(start / count, "Measuring fine detail")
        part = slice(start, min(start + BLOCK, count))
        some = texels.block(part)
        normal = some.across(chart, chart.normals)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        height[part], trust[part] = _measured(some.points(chart), normal, target, settle)
        trust[part] *= some.across(chart, trusted)
    return height, trust


def _measured(points, normals, target: Surface, settle):
    """Where the line along each normal meets the scan near it: height (k,) mm, trust (k,)."""
    found = target.ranked(points, normals, REACH, AGREE, near=5)
    place = np.where(found.found[:, None], curved(target, found, settle), points)
    gap = place - points
    height = np.einsum("ij,ij->i", gap, found.normals)
    facing = np.einsum("ij,ij->i", found.normals, normals)
    height /= np.maximum(facing, AGREE)
    # Beyond the scan's convex edges the tangent plane runs off: no farther than the distance itself.
    away = np.linalg.norm(gap, axis=1)
    height = np.clip(height, -1.2 * away, 1.2 * away)
    trust = np.where(found.found & ~found.border, np.clip((facing - AGREE) / (1 - AGREE) * 2, 0, 1), 0.0)
    trust *= np.clip((REACH - np.abs(height)) / (REACH - SURE), 0, 1)
    return height, trust * np.clip(target.piece_area[np.maximum(found.triangle, 0)] / WHOLE, 0, 1)


def lifted(points, corner, weights, target: Surface) -> np.ndarray:
    """(k, 3) mm from ``points`` of flat triangles to the curved surface that the normals at their corners suggest."""
    lift = np.zeros_like(points)
    for k in range(3):
        normal = target.normals[corner[:, k]]
        off = np.einsum("ij,ij->i", points - target.vertices[corner[:, k]], normal)
        lift -= (0.5 * weights[:, k] * off)[:, None] * normal
    return lift


def settling(target: Surface) -> np.ndarray:
    """(n, 3) mm for each vertex of ``target``: how far the curved surface stands out over the flat one around it.

    Less by that, the curved surface lies as far outside the triangles as inside them. The mean of a lift over a triangle
    is that of the middles of its sides, since it is quadratic.
    """
    corner = target.triangles
    mean = np.zeros((len(corner), 3))
    for weights in ((0.5, 0.5, 0.0), (0.0, 0.5, 0.5), (0.5, 0.0, 0.5)):
        weights = np.tile(weights, (len(corner), 1))
        points = np.einsum("ki,kij->kj", weights, target.vertices[corner])
        mean += lifted(points, corner, weights, target) / 3
    count, area = len(target.vertices), np.repeat(target.area, 3)
    total = np.maximum(np.bincount(corner.ravel(), area, count), 1e-12)
    return np.stack([np.bincount(corner.ravel(), area * np.repeat(m, 3), count) / total for m in mean.T], axis=1)


def curved(target: Surface, found, settle) -> np.ndarray:
    """(k, 3) the points found, taken from the flat triangles to the surface that their normals suggest.

    Phong tessellation with the factor 1/2 (see `chart`): a coarse scan must not print its facets.
    """
    corner = target.triangles[np.maximum(found.triangle, 0)]
    lift = lifted(found.points, corner, found.weights, target)
    lift -= np.einsum("ki,kij->kj", found.weights, settle[corner])
    length = np.linalg.norm(lift, axis=1, keepdims=True)
    return found.points + lift * np.minimum(1, LIFT / np.maximum(length, 1e-9))
