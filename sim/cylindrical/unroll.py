# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that are an unrolled range map: the map they were made of, texel for texel.

Scanners' own programs write a mesh as a grid, one line of vertices per height or per longitude. Then the lines of one
longitude lie in planes through the axis and those of one height in planes across it, evenly spaced.
"""

import numpy as np

from ..mesh import Mesh
from .range_map import TURN, RangeMap

#: How exactly the lines must lie in their planes, mm, and how even their spacing must be, relative.
PLANE, EVEN = 0.02, 0.02
SMALLEST = 12


def unrolled(mesh: Mesh) -> RangeMap | None:
    """The range map that ``mesh`` (mm, Z about up) is a grid of, or None if it is none. Vertices of no face are voids."""
    n = len(mesh.vertices)
    for lines in range(SMALLEST, n // SMALLEST + 1):
        if n % lines:
            continue
        grid = mesh.vertices.reshape(lines, n // lines, 3)
        for by_longitude in (True, False):  # lines of one longitude, or of one height
            found = _as_map(grid if by_longitude else grid.transpose(1, 0, 2), mesh, by_longitude)
            if found is not None:
                return found
    return None


def _as_map(grid: np.ndarray, mesh: Mesh, by_longitude: bool) -> RangeMap | None:
    """The map of ``grid`` (longitudes, heights, 3), if it is one."""
    up = _common_normal(grid.transpose(1, 0, 2))
    if up is None:
        return None
    up = up * np.sign(up[2] or 1.0)
    height = np.median(grid @ up, axis=0)
    rise = np.diff(height)
    if abs(rise.mean()) < 1e-6 or np.abs(rise - rise.mean()).max() > EVEN * abs(rise.mean()):
        return None
    normal = _plane_normals(grid)
    if normal is None:
        return None
    # The axis is where the planes of all longitudes meet.
    middle = grid.mean(axis=1)
    flat = normal - (normal @ up)[:, None] * up
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    origin = np.linalg.lstsq(
        np.vstack([flat, up * 10]), np.append(np.einsum("ij,ij->i", flat, middle), 0.0), rcond=None
    )[0]
    out = middle - origin
    out -= (out @ up)[:, None] * up
    if np.abs(np.einsum("ij,ij->i", flat, out)).max() > PLANE * 5:
        return None
    front = out[len(out) // 2] / np.linalg.norm(out[len(out) // 2])
    if len(out) * 1.05 > TURN / max(abs(_turn(out[0], out[1], up)), 1e-9):
        front = np.array([0.0, -1.0, 0.0]) - up * -up[1]  # all the way round: the front is where it is in the mesh
        front /= np.linalg.norm(front)
    back = -front
    axes = np.stack([np.cross(back, up), back, up])
    local = (grid - origin) @ axes.T
    longitude = np.unwrap(np.arctan2(out @ axes[0], -(out @ axes[1])))
    step = np.diff(longitude)
    if np.abs(step - step.mean()).max() > EVEN * abs(step.mean()) or abs(step.mean()) < 1e-4:
        return None
    radius = np.hypot(local[..., 0], local[..., 1]).T
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[mesh.faces[mesh.faces >= 0]] = True
    shape = grid.shape[:2] if by_longitude else grid.shape[1::-1]
    valid = used.reshape(shape).T if by_longitude else used.reshape(shape)
    colour = None
    if mesh.colour is not None:
        colour = mesh.colour.reshape(*shape, 3)
        colour = colour.transpose(1, 0, 2) if by_longitude else colour
    if step.mean() < 0:
        radius, valid, longitude = radius[:, ::-1], valid[:, ::-1], longitude[::-1]
        colour = None if colour is None else colour[:, ::-1]
    if rise.mean() > 0:
        radius, valid, height = radius[::-1], valid[::-1], height[::-1]
        colour = None if colour is None else colour[::-1]
    return RangeMap(
        np.where(valid, radius, np.nan),
        valid.copy(),
        None if colour is None else np.ascontiguousarray(colour, dtype=np.float32),
        float(longitude[0]),
        abs(float(step.mean())),
        float(height[0] - origin @ up),
        abs(float(rise.mean())),
        origin,
        axes,
    )


def _turn(a, b, up):
    return np.arctan2(np.cross(a, b) @ up, a @ b)


def _plane_normals(lines: np.ndarray) -> np.ndarray | None:
    """(k, 3) unit normals of the planes that the lines (k, m, 3) lie in, or None if one lies in none."""
    off = lines - lines.mean(axis=1, keepdims=True)
    if np.linalg.svd(off[len(off) // 2], compute_uv=False)[2] > PLANE * np.sqrt(lines.shape[1]):
        return None  # most meshes are refused here, cheaply
    _, size, axes = np.linalg.svd(off, full_matrices=False)
    if (size[:, 2] > PLANE * np.sqrt(lines.shape[1])).any():
        return None
    # a straight line lies in many planes
    normal = axes[:, 2]
    if (size[:, 1] < 0.2).any():
        return None
    return normal


def _common_normal(lines: np.ndarray) -> np.ndarray | None:
    """(3,) the unit normal shared by the planes of all lines, or None."""
    normal = _plane_normals(lines)
    if normal is None:
        return None
    normal = normal * np.sign(normal @ normal[len(normal) // 2])[:, None]
    mean = normal.mean(axis=0)
    mean /= np.linalg.norm(mean)
    return mean if (normal @ mean).min() > 0.9999 else None
