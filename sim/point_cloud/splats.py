# SPDX-License-Identifier: GPL-3.0-or-later
"""Points on Gaussian splats, from the columns that programs which train and edit them write into PLY files.

After Kerbl, Kopanas, Leimkuehler and Drettakis 2023, "3D Gaussian splatting for real-time radiance field rendering", section 4.

A splat is a soft ellipsoid, mostly a flat one that lies in the surface. They are few and wide where a surface is plain, as on a
cheek, and small and many where it is not, as about an eye: their middles alone would leave the cheek to guesswork.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from ..mesh import Mesh
from .neighbourhoods import SPECK, nearest, pieces

OPACITY, SCALES, TURNS = "opacity", ("scale_0", "scale_1", "scale_2"), ("rot_0", "rot_1", "rot_2", "rot_3")
COLOURS = ("f_dc_0", "f_dc_1", "f_dc_2")
#: What compressed files have instead, several numbers in the bits of one.
PACKED = "packed_position"
#: The first spherical harmonic, which is the same in all directions.
HARMONIC = 0.5 / np.sqrt(np.pi)
#: What is less opaque than this is haze, or colours the surface behind it.
SOLID = 0.5
#: What is so many times as wide as most is background; what is so many times as long as wide is a strand, and its middle stands
#: for it.
WIDE, LONG = 20.0, 6.0
#: Splats hang together that lie no farther apart than so many times the smaller one's standard deviation; of so many nearest.
TOGETHER, NEAREST = 3.0, 9
#: Points lie no farther from the middle than so many standard deviations, in steps of those that most splats have across.
REACH = 1.0
#: More points are not made: bounds the memory.
MOST = 200_000


def are_splats(columns: dict) -> bool:
    """Whether the ``columns`` of a PLY file's vertices are those of splats."""
    return all(name in columns for name in (OPACITY, *SCALES, *TURNS))


def on_splats(points: np.ndarray, columns: dict) -> Mesh:
    """A mesh without faces: points on those splats that are solid, in the unit of ``points`` (n, 3), their middles.

    ``columns`` has for each name a column (n,): opacities before the logistic function, logarithms of standard deviations,
    quaternions with the real part first, and the colours' first harmonics if there are any.
    """
    solid = np.asarray(columns[OPACITY], dtype=np.float64) > np.log(SOLID / (1 - SOLID))
    usable = np.isfinite(points).all(axis=1) & np.isfinite(_stacked(columns, (*SCALES, *TURNS))).all(axis=1) & solid
    points = points[usable]
    colour = None
    if all(name in columns for name in COLOURS):
        colour = np.clip(0.5 + HARMONIC * _stacked(columns, COLOURS)[usable], 0, 1).astype(np.float32)
    u, v = _half_axes(_stacked(columns, SCALES)[usable], _stacked(columns, TURNS)[usable])
    kept = np.flatnonzero(_of_surface(points, u, v))
    placed, owner = _spread(points[kept], u[kept], v[kept])
    owner = kept[owner]
    return Mesh(placed, np.zeros((0, 4), np.int32), colour=None if colour is None else colour[owner])


def _stacked(columns, names):
    return np.stack([np.asarray(columns[name], dtype=np.float64) for name in names], axis=1)


def _half_axes(scales, turns):
    """The longest and the second axis (n, 3) each, as long as the standard deviation along it."""
    length = np.exp(np.clip(scales, -80, 80))
    turns = np.where(np.abs(turns).max(axis=1, keepdims=True) > 0, turns, [1.0, 0, 0, 0])
    axes = Rotation.from_quat(turns[:, [1, 2, 3, 0]]).as_matrix() * length[:, None, :]
    order = np.argsort(-length, axis=1)
    rows = np.arange(len(axes))
    return axes[rows, :, order[:, 0]], axes[rows, :, order[:, 1]]


def _of_surface(points, u, v):
    """(n,) bool: splats that are no background, and that hang together with `SPECK` others or more."""
    if len(points) < NEAREST:
        return np.ones(len(points), bool)
    long, short = np.linalg.norm(u, axis=1), np.linalg.norm(v, axis=1)
    narrow = np.flatnonzero(short <= WIDE * np.median(short))
    distance, near = nearest(points[narrow], min(NEAREST, len(narrow)))
    long = long[narrow]
    piece = pieces(near[:, 1:], distance[:, 1:] < TOGETHER * np.minimum(long[:, None], long[near[:, 1:]]))
    kept = np.zeros(len(points), bool)
    kept[narrow] = np.bincount(piece)[piece] >= SPECK
    return kept


def _spread(points, u, v):
    """Points (m, 3) on ellipses about ``points`` (n, 3) with half axes ``u``, ``v`` (n, 3); and which (m,) each lies on."""
    if not len(points):
        return points, np.zeros(0, np.int64)
    long, short = np.linalg.norm(u, axis=1), np.linalg.norm(v, axis=1)
    strand = long > LONG * short
    area = np.where(strand, 0.0, long * short) * np.pi * REACH**2
    step = max(np.median(short), np.sqrt(area.sum() / MOST))
    one, other = (np.where(strand, 0, np.rint(REACH * half / step)).astype(np.int64) for half in (long, short))
    placed, owner = [], []
    kinds, kind = np.unique(np.stack([one, other], axis=1), axis=0, return_inverse=True)
    for k, (across, along) in enumerate(kinds):
        some = np.flatnonzero(kind.ravel() == k)
        places = np.stack(np.meshgrid(_steps(across), _steps(along)), axis=-1).reshape(-1, 2)
        x, y = REACH * places[(places**2).sum(axis=1) <= 1.0][:, :, None, None].swapaxes(0, 1)
        placed.append((points[some] + x * u[some] + y * v[some]).reshape(-1, 3))
        owner.append(np.tile(some, len(x)))
    return np.concatenate(placed), np.concatenate(owner)


def _steps(count):
    """Places from -1 to 1, so many on each side of the middle."""
    return np.arange(-count, count + 1) / max(count, 1)
