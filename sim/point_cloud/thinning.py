# SPDX-License-Identifier: GPL-3.0-or-later
"""Fewer points, where they lie closer than is of use, and fewer still where they are noisy: the averages of those together."""

from dataclasses import dataclass

import numpy as np

from ..progress import Progress, Work
from .neighbourhoods import nearest, planes, spacing

#: Nearest points, itself with them, that tell the plane of each.
AROUND = 12
#: Points that lie off their plane by more than this part of their spacing are noise, on average about them, or by themselves if
#: they are `SPARSE` times as far apart as most; unless most lie off by less than `CLEAN`, as then those are but as finely
#: shaped as they lie. Then only sparse ones are that lie as far off as points in a solid do, .44 to .57.
THICK, CLEAN = 0.3, 0.25
SOLID, SPARSE = 0.42, 2.0
#: Points so many times as far apart as most are strewn about, or of something far behind.
STREWN = 8.0
#: Noisy points are averaged over cubes so many times as wide, so often; what is in no plane then is on no surface.
WIDER, TIMES = 1.5, 8


@dataclass(frozen=True, eq=False)
class Settled:
    """Points (n, 3) of a surface, no noisier than they are apart.

    values : (n, k) of theirs; facing : (n, 3) unit normals of either sign; apart : (n,); distance, near : (n, `AROUND`) to
    the nearest, itself first, and which these are
    """

    points: np.ndarray
    values: np.ndarray
    facing: np.ndarray
    apart: np.ndarray
    distance: np.ndarray
    near: np.ndarray

    @classmethod
    def of(cls, points, values) -> tuple["Settled", np.ndarray]:
        """Of the points as they are; and how far (n,) they lie off their planes, in spacings, on average about them."""
        distance, near = nearest(points, AROUND)
        facing, off = planes(points, near)
        apart = spacing(distance)
        own = thick = off / apart
        for _ in range(2):
            thick = thick[near].mean(axis=1)
        sparse = apart > SPARSE * np.median(apart)
        return cls(points, values, facing, apart, distance, near), np.where(sparse, np.maximum(own, thick), thick)


def settling(points: np.ndarray, values: np.ndarray, cell: float, label: str) -> Work:
    """Work returning `Settled` of ``points`` (n, 3) with ``values`` (n, k), averaged over cubes with sides of ``cell`` or more.

    What lies on no surface is gone; None: too few are left.
    """
    done, done_values = points[:0], values[:0]
    clean = False
    for time in range(TIMES + 1):
        yield Progress(time / (TIMES + 1), label)
        few, few_values, owner = thinned(points, cell * WIDER**time, values)
        if len(done) + len(few) < AROUND:
            return None
        cloud, thick = Settled.of(np.concatenate([done, few]), np.concatenate([done_values, few_values]))
        clean = clean or (time == 0 and bool(np.median(thick) < CLEAN))
        most = np.median(cloud.apart)
        noisy = (thick > SOLID) & (cloud.apart > SPARSE * most) if clean else thick > THICK
        strewn = (cloud.apart > STREWN * most)[len(done) :] & (time == 0)  # later on noise is as far apart
        noisy = noisy[len(done) :] & ~strewn
        if not (noisy | strewn).any():
            return cloud
        fine = ~(noisy | strewn)
        done, done_values = np.concatenate([done, few[fine]]), np.concatenate([done_values, few_values[fine]])
        left = noisy[owner]
        points, values = points[left], values[left]
        if not len(points):
            break
    return Settled.of(done, done_values)[0] if len(done) >= AROUND else None


def thinned(points: np.ndarray, cell: float, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One point for each cube with sides of ``cell`` that has any of ``points`` (n, 3), where they lie on average; the
    mean of their ``values`` (n, k); and which of these (n,) each is of."""
    places = np.floor((points - points.min(axis=0)) / cell).astype(np.int64)
    span = places.max(axis=0) + 1
    key = (places[:, 0] * span[1] + places[:, 1]) * span[2] + places[:, 2]
    _, owner, share = np.unique(key, return_inverse=True, return_counts=True)
    mean = np.stack([np.bincount(owner, column) / share for column in (*points.T, *values.T)], axis=1)
    return mean[:, :3], mean[:, 3:], owner
