# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a face stands in a range map: the generic face laid on it, nose on nose, and turned until it fits.

The map itself answers where the surface is, so that each step of the closest-point iteration (Besl and McKay 1992;
Chen and Medioni 1992 for the distance along normals) costs a look-up.
"""

from dataclasses import dataclass

import numpy as np

from ..anatomy.head import Head
from ..errors import InputError
from ..mesh import vertex_normals
from .nose import nose_candidates, nose_tip
from .range_map import RangeMap

#: Points of the generic face that are laid on the map.
SAMPLES = 500
#: Distance at which a point begins to count as missing, mm, from the first step to the last.
FROM, TO = 12.0, 4.0
#: Spread of human head sizes about the generic's, and of how far heads are tilted or turned on an upright scan, rad.
SIZES, TILTS = 0.08, 0.3
#: Starts of nodding and turning, rad.
NODS, TURNS = (-0.3, 0.0, 0.3), (-0.25, 0.0, 0.25)


@dataclass(frozen=True, eq=False)
class Pose:
    """The similarity that lays the generic head on a scan: ``scale * rotation @ p + shift``; misfit in 0..1."""

    rotation: np.ndarray
    shift: np.ndarray
    scale: float
    misfit: float

    def apply(self, points: np.ndarray) -> np.ndarray:
        """Points (n, 3) mm of the generic head -> the scan's place."""
        return self.scale * np.asarray(points) @ self.rotation.T + self.shift


def find_pose(range_map: RangeMap, reference: Head, within: float = np.pi) -> Pose:
    """The pose of the face in ``range_map``; ``within`` rad of longitude 0 its nose is looked for.

    Raises
    ------
    InputError : nothing in the map stands out as a nose does.
    """
    points, normals = _face(reference)
    tip = reference.landmark_positions()["prn"]
    normal_map = _normals(range_map)
    best = None
    for row, column in nose_candidates(range_map, within=within):
        row, column = nose_tip(range_map, row, column)
        found = range_map.place(row, column)
        if not np.isfinite(found).all():
            continue
        longitude = range_map.first + range_map.step * column
        ahead = range_map.axes.T
        for nod in NODS:
            for turn in TURNS:
                rotation = ahead @ _about(2, longitude + turn) @ _about(0, nod)
                start = Pose(rotation, found - rotation @ tip, 1.0, np.inf)
                pose = _settle(start, points[::4], normals[::4], range_map, normal_map, 10)
                if best is None or pose.misfit < best.misfit:
                    best = pose
    if best is None:
        raise InputError("Nothing in the scan stands out as a nose does: give landmarks, or another scan.")
    return _settle(best, points, normals, range_map, normal_map, 25, last=True)


def _about(axis: int, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out = np.eye(3)
    out[i, i] = out[j, j] = c
    out[i, j], out[j, i] = -s, s
    return out


def _face(reference: Head):
    """Points (k, 3) and normals (k, 3), evenly strewn over the generic face without eyes, mouth and nostrils."""
    skin = reference.skin
    groups = reference.groups
    face = np.asarray(groups["face"]) > 0.5
    for name in ("inner", "nostril_l", "nostril_r", "lid_upper_l", "lid_upper_r", "lid_lower_l", "lid_lower_r"):
        if name in groups:
            face &= np.asarray(groups[name]) < 0.3
    normals = vertex_normals(skin.vertices, skin.triangles)
    at = np.flatnonzero(face)
    # Fine parts of the mesh must not outweigh coarse ones: one vertex per cell of a grid.
    cell = np.floor(skin.vertices[at] / 5.0).astype(np.int64)
    key = (cell[:, 0] + 512) << 20 | (cell[:, 1] + 512) << 10 | (cell[:, 2] + 512)
    _, first = np.unique(key, return_index=True)
    at = at[np.sort(first)]
    at = at[:: max(len(at) // SAMPLES, 1)]
    return skin.vertices[at], normals[at]


def _normals(range_map: RangeMap) -> np.ndarray:
    """(h, w, 3) unit normals of the map's surface, NaN beside voids."""
    points = range_map.points()
    across = np.roll(points, -1, axis=1) - np.roll(points, 1, axis=1)
    if not range_map.closed:
        across[:, [0, -1]] = np.nan
    down = np.full_like(points, np.nan)
    down[1:-1] = points[2:] - points[:-2]
    normal = np.cross(down, across)
    with np.errstate(invalid="ignore"):
        return normal / np.linalg.norm(normal, axis=2, keepdims=True)


def _settle(pose: Pose, points, normals, range_map, normal_map, rounds, last=False) -> Pose:
    """Move, turn and scale until the points lie on the map; robust, with the priors `SIZES` and `TILTS`."""
    rotation, shift, scale = pose.rotation, pose.shift, pose.scale
    upright = range_map.axes.T
    for k in range(rounds):
        spread = max(FROM * (TO / FROM) ** (k / (0.7 * rounds)), TO) if not last else TO
        turned = points @ rotation.T
        now = scale * turned + shift
        rows, columns, radius = range_map.texels(now)
        i, j = np.rint(rows).astype(int), np.rint(columns).astype(int)
        h, w = range_map.shape
        if range_map.closed:
            j = np.mod(j, w)
        inside = (i >= 0) & (i < h) & (j >= 0) & (j < w)
        i, j = np.where(inside, i, 0), np.where(inside, j, 0)
        normal = normal_map[i, j]
        gap = np.where(inside, range_map.sample(rows, columns), np.nan) - radius
        axis = range_map.origin + ((now - range_map.origin) @ range_map.axes[2])[:, None] * range_map.axes[2]
        out = (now - axis) / np.maximum(radius, 1e-6)[:, None]
        miss = gap * np.einsum("ij,ij->i", normal, out)
        agree = np.einsum("ij,ij->i", normal, normals @ rotation.T)
        good = np.isfinite(miss) & (agree > 0.3)
        miss, agree = np.where(good, miss, 0.0), np.where(good, agree, 0.0)
        weight = np.where(good, agree / (1 + (miss / spread) ** 2) ** 2, 0.0)
        if weight.sum() < 0.1 * len(points):
            return Pose(rotation, shift, scale, np.inf)
        n = np.where(good[:, None], normal, 0.0)
        slope = np.column_stack([np.cross(scale * turned, n), n, np.einsum("ij,ij->i", n, turned)])
        matrix = (slope * weight[:, None]).T @ slope
        pull = (slope * weight[:, None]).T @ miss
        strength = weight.sum() * TO**2
        matrix[6, 6] += strength / SIZES**2 / 100
        pull[6] -= strength / SIZES**2 / 100 * (scale - 1)
        matrix += 1e-6 * np.trace(matrix) / 7 * np.eye(7)
        move = np.linalg.solve(matrix, pull)
        angle = np.linalg.norm(move[:3])
        if angle > 0.2:
            move *= 0.2 / angle
        rotation = _turn(move[:3]) @ rotation
        shift, scale = shift + move[3:6], float(np.clip(scale + move[6], 0.6, 1.5))
    fit = np.where(good, np.maximum(agree, 0) / (1 + (miss / TO) ** 2), 0.0)
    # what is not in the scan neither speaks for a pose nor, up to half of the face, much against it
    tilt = np.arccos(np.clip(rotation[:, 2] @ upright[:, 2], -1, 1))
    misfit = 1 - fit.mean() * (0.6 + 0.4 * fit.sum() / max(good.sum(), 1)) + 0.1 * (tilt / TILTS) ** 2
    return Pose(rotation, shift, scale, float(misfit))


def _turn(vector: np.ndarray) -> np.ndarray:
    """(3, 3) rotation by a rotation vector (Rodrigues)."""
    angle = np.linalg.norm(vector)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k
