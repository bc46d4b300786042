# SPDX-License-Identifier: GPL-3.0-or-later
"""Depth maps as sheets of triangles, and the sheets of several views put together."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import binary_erosion

from ..mesh import Mesh


def sheet(capture, tear: float) -> Mesh:
    """The triangles between neighbouring pixels of one capture; ``tear`` mm of depth within a triangle leaves a gap."""
    depth = capture.depth
    valid = np.isfinite(depth)
    row, column = np.nonzero(valid)
    points = capture.placed(capture.camera.points(column + 0.5, row + 0.5, depth[valid]))
    index = np.full(depth.shape, -1, dtype=np.int64)
    index[valid] = np.arange(len(points))
    corner = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1).reshape(-1, 4)
    z = np.where(valid, depth, 0)
    z = np.stack([z[:-1, :-1], z[1:, :-1], z[1:, 1:], z[:-1, 1:]], axis=-1).reshape(-1, 4)
    # each cell is cut along the diagonal that bends less
    along = np.abs(z[:, 0] - z[:, 2]) <= np.abs(z[:, 1] - z[:, 3])
    along = np.where((corner[:, [0, 2]] < 0).any(axis=1), False, along | (corner[:, [1, 3]] < 0).any(axis=1))
    cuts = [[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]
    triangles, depths = [], []
    for chosen, halves in ((along, cuts[0]), (~along, cuts[1])):
        for half in halves:
            triangles.append(corner[chosen][:, half])
            depths.append(z[chosen][:, half])
    triangles, depths = np.concatenate(triangles), np.concatenate(depths)
    keep = (triangles >= 0).all(axis=1) & (np.ptp(depths, axis=1) < tear)
    return Mesh.from_triangles(points, triangles[keep], colour=capture.colour[valid].astype(np.float32))


def trimmed(captures: list, strip: float, apart: float = 2.5) -> list:
    """The captures without what another one measured better, but for a strip of so many pixels along the seams.

    Overlapping parts agree to ``apart`` mm. After Turk and Levoy 1994, section 4 (redundant surfaces are eaten away).
    """
    redundant = []
    for k, capture in enumerate(captures):
        valid = np.isfinite(capture.depth)
        row, column = np.nonzero(valid)
        points = capture.camera.points(column + 0.5, row + 0.5, capture.depth[valid])
        own = capture.quality[valid]
        better = np.zeros(len(points), dtype=bool)
        for j, other in enumerate(captures):
            if j == k:
                continue
            x, y, depth = other.camera.project(points).T
            inside = (x > 0) & (y > 0) & (x < other.camera.width) & (y < other.camera.height)
            at = np.where(inside, y, 0).astype(int), np.where(inside, x, 0).astype(int)
            there = other.depth[at]
            with np.errstate(invalid="ignore"):
                better |= inside & (np.abs(there - depth) < apart) & (other.quality[at] > own)
        image = np.zeros(valid.shape, dtype=bool)
        image[valid] = better
        redundant.append(image | ~valid)
    steps = max(int(round(strip / 2)), 1)
    out = []
    for capture, image in zip(captures, redundant, strict=True):
        away = binary_erosion(image, iterations=steps, border_value=1)
        out.append(replace(capture, depth=np.where(away, np.inf, capture.depth)))
    return out


def joined(meshes: list[Mesh]) -> Mesh:
    """Several coloured meshes as one, not connected to each other."""
    shift = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    return Mesh.from_triangles(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, shift[:-1], strict=True)]),
        colour=np.concatenate([mesh.colour for mesh in meshes]),
    )
