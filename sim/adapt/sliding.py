# SPDX-License-Identifier: GPL-3.0-or-later
"""The warped skin slides over the scan: vertices spread over it hold to the data beside them across the surface only."""

import numpy as np
from scipy.spatial import cKDTree

from ..mesh import vertex_normals
from .closest import Surface
from .refine import Pairs, scattered
from .sliding_warp import Mirror, SlidingWarp

REACH, AGREE = 12.0, 0.6  # mm from a site to the data that it belongs to, and the cosine between their normals
SLACK = 0.7  # mm by which a site may miss it, one standard deviation: what is finer is left to the last stage
WIDE = 3.0  # mm off from which on it counts as an outlier
ACROSS = 3.0  # how much less sure a landmark is across the surface, where the data know better
CLOSE, APART = 14.0, 18.0  # mm between sites, where they are to lie close together and elsewhere


def spread_sites(skin, triangles, close) -> np.ndarray:
    """(m,) vertices of ``triangles`` (t, 3), spread evenly over ``skin`` (n, 3) mm, closer together where ``close`` (n,)
    bool."""
    some = np.unique(triangles)
    parts = ((some[close[some]], CLOSE), (some[~close[some]], APART))
    return np.concatenate([at[scattered(skin[at], gap)] for at, gap in parts])


def slide(rest, skin, outer, sites, target: Surface, pairs: Pairs, mirror: Mirror) -> np.ndarray:
    """``rest`` (n, 3) mm warped to the scan: near the landmarks, and on the data beside the vertices ``sites`` (m,).

    Parameters
    ----------
    rest : (n, 3) mm, the skin as its displacement is to be smooth against
    skin : (n, 3) mm, the same where it lies now, near the scan
    outer : (t, 3) triangles of it that a scanner can see
    pairs : landmarks on ``rest`` and on the target; ``give`` is how unsure each is along the surface, mm
    mirror : between left and right of ``rest``
    """
    normal = vertex_normals(skin, outer)
    found = target.ranked(skin[sites], normal[sites], REACH, AGREE)
    there = np.flatnonzero(found.found & ~found.border)
    places, facing = found.points[there], found.normals[there]
    miss = np.einsum("ij,ij->i", places - skin[sites[there]], facing)
    slack = SLACK * (1 + (miss / WIDE) ** 2)
    used = np.unique(outer)
    frames = framed(normal[used[cKDTree(skin[used]).query(pairs.target)[1]]])
    noise = pairs.give[:, None] * np.array([1.0, 1.0, ACROSS])
    held = pairs.source, pairs.target, frames, noise
    warp = SlidingWarp.fit(*held, rest[sites[there]], places, facing, slack, mirror)
    return warp.transform(rest)


def framed(normals) -> np.ndarray:
    """(k, 3, 3) orthonormal rows of which the last are the unit ``normals`` (k, 3)."""
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(normals, axis)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normals, first), normals], axis=1)
