# SPDX-License-Identifier: GPL-3.0-or-later
"""The last stage: the skin's own vertices move onto the data, held together by a smooth displacement.

After the warps the skin lies near the scan wherever there are landmarks; here it reaches the limit of its own mesh.
Each round pairs points of the skin with places on the scan that face the same way, throws out open sides, specks and
outliers, and solves for the displacement that is closest to the data across the surface and smoothest elsewhere
(bending energy, the discrete bi-Laplacian), more softly in each round.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix, vstack

from ..mesh import cross_sides, vertex_normals
from ..mesh_subdivision import drawn, undrawn
from .closest import Surface
from .drawn_points import DrawnPoints, drawn_points, own_points
from .smooth_system import ROUGHLY, SOLVED, Smoothness, solve_displacement
from .tracked import Tracked

#: One round each: stiffness of bending, reach in mm, width in mm of what counts as an outlier. The last may be repeated.
SCHEDULE = (
    (4.0, 12.0, 4.0),
    (0.6, 9.0, 3.0),
    (0.12, 6.0, 2.0),
    (0.04, 5.0, 1.2),
    (0.015, 4.0, 1.0),
    (0.005, 4.0, 1.0),
)
ALONG = 0.02  # weight of a pull along the surface against one across it
AGREE = 0.6  # cosine between the normals of skin and scan
WHOLE = 150.0  # mm²: a piece of data smaller than this is trusted in proportion
FINE = 0.05  # stiffness below which data in between the cage's vertices is looked for too
BEGUN, STIFF = 0.2, 0.6  # mm off in the mean: a skin as near as that takes a single stiff round, and how stiff that is
AT_ONCE = 0.1  # mm off in the mean before that one: a skin as near as that takes the last round next, and only once
NEAR = 0.045  # mm off in the mean: a skin as near as that takes the last round at once
LEFT = 0.07  # mm by which the last round may find the skin off, in the mean
AGAIN = 2  # times at most that it is repeated if it is farther off
LAST = 0.02  # stiffness below which rims look for data
CLOSE = 1.5  # mm: how far they look


@dataclass(frozen=True, eq=False)
class Anchors:
    """Landmarks on the skin and where they belong.

    sampling (k, n) sparse rows that give the landmark (or the offset between two points) from the drawn vertices; target
    (k, 3) mm; weight (k,), 1 for a point of data.
    """

    sampling: csr_matrix
    target: np.ndarray
    weight: np.ndarray


@dataclass(frozen=True, eq=False)
class Fitted:
    """cage (n, 3) mm; vertices (n, 3) mm, of the surface drawn of it; fitted (n,) 0..1, how far data decided the
    place; distance (n,) mm to the scan, signed (positive outside) and NaN where there is none."""

    cage: np.ndarray
    vertices: np.ndarray
    fitted: np.ndarray
    distance: np.ndarray


def matches(rows, points, normals, tracked: Tracked, reach: float):
    """Where on the scan the points number ``rows`` (k,) of the skin, now at ``points`` (k, 3), belong, and how far to
    trust it.

    Returns the `Contacts` and trust (k,) 0..1.
    """
    found = tracked.ranked(rows, points, normals, reach, AGREE)
    agree = np.einsum("ij,ij->i", found.normals, normals)
    trust = np.where(found.found & ~found.border, np.clip((agree - AGREE) / (1 - AGREE) * 1.5, 0.05, 1), 0)
    trust *= np.clip(tracked.target.piece_area[np.maximum(found.triangle, 0)] / WHOLE, 0, 1)
    return found, trust


def fine_fit(cage, faces, free, rim, target: Surface, anchors: Anchors, stiffness=None):
    """A generator: yields the fraction done, returns `Fitted`.

    Parameters
    ----------
    cage (n, 3) mm : the cage of the warped skin
    faces (m, 4) : its quads
    free (n,) bool : vertices that look for data; the others (mouth bag, lid backs, nostrils) follow smoothly
    rim (n,) bool : vertices that look for data in the last rounds only, and only close by (margins of lips and lids)
    stiffness (n,) : factor on the bending stiffness of each vertex (1 everywhere by default)
    """
    n, turns = len(cage), len(SCHEDULE) + AGAIN
    base = drawn(faces, np.asarray(cage, dtype=float))
    smooth = Smoothness(base, faces, np.ones(n) if stiffness is None else stiffness)
    surface = drawn_points(faces, free, free | rim)
    tracked = Tracked(target, surface.rows.shape[0])
    # While the skin is stiff, the drawn surface's own vertices stand for all of it: a small system.
    own = own_points(faces, free, free | rim)
    stiff = [step for step in SCHEDULE if step[0] >= FINE]
    moved = np.zeros((n, 3))
    for turn, step in enumerate(stiff):
        smooth.factor = None  # each is far softer than the one before
        moved, off = nearer(base, moved, own, tracked, anchors, smooth, step, None if turn else (BEGUN, STIFF))
        yield (turn + 1) / turns
        if off <= BEGUN and not turn:
            break
    near = not turn and off <= AT_ONCE
    soft, left = ([SCHEDULE[-1]], AT_ONCE) if near else (list(SCHEDULE[len(stiff) :]), LEFT)
    base = undrawn(faces, base + moved, base + moved)
    moved = np.zeros((n, 3))
    smooth.factor = None
    anchors = replace(anchors, sampling=(anchors.sampling @ surface.rows[:n]).tocsr())
    for turn, step in enumerate(soft + soft[-1:] * AGAIN):
        at_once = (NEAR, soft[-1][0]) if step[0] < LAST else None
        moved, off = nearer(base, moved, surface, tracked, anchors, smooth, step, at_once)
        yield (len(stiff) + turn + 1) / turns
        if off <= (left if turn + 1 >= len(soft) else NEAR) and step[0] < LAST:
            break
    cage = base + moved
    now = surface.rows @ cage
    vertices = now[:n]
    normal = vertex_normals(now, surface.outer)[:n]
    look = np.flatnonzero(free)
    found, sure = matches(look, vertices[look], normal[look], tracked, 3.0)
    trust, gap = np.zeros(n), np.full(n, np.nan)
    trust[look] = np.clip(sure, 0, 1)
    some = sure > 0
    gap[look[some]] = np.einsum("ij,ij->i", vertices[look[some]] - found.points[some], found.normals[some])
    return Fitted(cage, vertices, trust, gap)


def nearer(
    base, moved, surface: DrawnPoints, tracked: Tracked, anchors: Anchors, smooth: Smoothness, step, instead=None
):
    """One round, from the displacement ``moved`` (n, 3) of ``base`` (n, 3), of which ``surface`` is made, to the next.

    step : of the schedule; instead : how far off the skin may be, mm in the mean, to be moved with another stiffness, and
    which. Surroundings of folds are made stiffer in ``smooth``. Returns the displacement (n, 3) mm, and how far off the data
    the skin was before, across it, in the mean, mm.
    """
    soft, reach, width = step
    now = surface.rows @ (base + moved)
    normal = vertex_normals(now, surface.outer)
    look = np.flatnonzero(surface.seen if soft < LAST else surface.look)
    points = surface.between(now)[look]
    found, trust = matches(look, points, normal[look], tracked, reach)
    trust[~surface.look[look] & (found.distance > CLOSE)] = 0
    use = np.flatnonzero(trust > 0)
    gap = found.points[use] - points[use]
    # The direction of the data's normal decides; a pinch of the skin's own keeps it calm on rough data.
    facing = found.normals[use] + 0.5 * normal[look[use]]
    facing /= np.linalg.norm(facing, axis=1, keepdims=True)
    height = np.einsum("ij,ij->i", gap, facing)
    robust = trust[use] / (1 + (height / width) ** 2) ** 2
    off = float(robust @ np.abs(height)) / max(float(robust.sum()), 1e-12)
    if instead is not None and off <= instead[0]:
        soft = instead[1]
    rows, k = surface.rows[look[use]], len(anchors.weight)
    # A point is pulled along the normal, and a little along the surface; an anchor every way.
    facing, along = np.concatenate([facing, np.zeros((k, 3))]), np.append(np.full(len(use), ALONG), np.ones(k))
    weight = np.concatenate([robust, anchors.weight])
    goal = np.concatenate([rows @ moved + gap, anchors.target - anchors.sampling @ base])
    pulls = facing * np.einsum("ij,ij->i", facing, goal)[:, None] + along[:, None] * goal
    sampling = vstack([rows, anchors.sampling]).tocsr()
    pulls *= weight[:, None]
    left = SOLVED if soft == SCHEDULE[-1][0] else ROUGHLY
    moved = solve_displacement(smooth, soft, sampling, weight, facing, along, pulls, moved, left)
    worse = folded(surface.rows @ base, surface.rows @ (base + moved), surface.triangles)
    if worse.any():
        at = np.zeros(len(now))
        at[surface.triangles[worse].ravel()] = 1
        smooth.stiffen(surface.rows.T @ at > 0.2)
    return moved, off


def folded(before, after, triangles, limit: float = 0.0):
    """Which triangles (t,) turned over: their normal against what it was is below ``limit`` (cosine)."""
    one, other = (cross_sides(*(p.T.take(triangles[:, k], axis=1) for k in range(3))) for p in (before, after))
    along = (one * other).sum(axis=0)
    if limit:
        along -= limit * np.sqrt((one**2).sum(axis=0) * (other**2).sum(axis=0))
    return along < 0
