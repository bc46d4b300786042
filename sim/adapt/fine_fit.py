# SPDX-License-Identifier: GPL-3.0-or-later
"""The last stage: the skin's own vertices move onto the data, held together by a smooth displacement.

After the warps the skin lies near the scan wherever there are landmarks; here it reaches the limit of its own mesh.
Each round pairs points of the skin with places on the scan that face the same way, throws out open sides, specks and
outliers, and solves for the displacement that is closest to the data across the surface and smoothest elsewhere
(bending energy, the discrete bi-Laplacian), more softly in each round.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags, vstack

from ..mesh import edges, vertex_normals
from .closest import Surface
from .drawn_points import drawn_points
from .smooth_system import laplacian, solve_displacement

#: One round each: stiffness of bending, reach in mm, width in mm of what counts as an outlier.
SCHEDULE = (
    (4.0, 12.0, 4.0),
    (1.5, 10.0, 3.0),
    (0.6, 8.0, 2.5),
    (0.25, 6.0, 2.0),
    (0.1, 5.0, 1.5),
    (0.04, 4.0, 1.2),
    (0.015, 4.0, 1.0),
    (0.005, 4.0, 1.0),
)
ALONG = 0.02  # weight of a pull along the surface against one across it
AGREE = 0.6  # cosine between the normals of skin and scan
WHOLE = 150.0  # mm²: a piece of data smaller than this is trusted in proportion
FINEST = 4.0  # most by which fine parts of the mesh are stiffened
FINE = 0.2  # stiffness below which data in between the cage's vertices is looked for too
LAST = 0.02  # stiffness below which rims look for data
CLOSE = 1.5  # mm: how far they look
STRETCH = 0.002  # weight of first differences, which keeps the mesh from sliding where bending is free


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


def matches(points, normals, target: Surface, reach: float):
    """Where on the scan ``points`` (k, 3) of the skin belong, and how far to trust it.

    Returns the `Contacts` and trust (k,) 0..1.
    """
    found = target.ranked(points, normals, reach, AGREE, near=32)
    agree = np.einsum("ij,ij->i", found.normals, normals)
    trust = np.where(found.found & ~found.border, np.clip((agree - AGREE) / (1 - AGREE) * 1.5, 0.05, 1), 0)
    trust *= np.clip(target.piece_area[np.maximum(found.triangle, 0)] / WHOLE, 0, 1)
    return found, trust


def fine_fit(cage, faces, free, rim, target: Surface, anchors: Anchors, stiffness=None, rounds=SCHEDULE):
    """A generator: yields the fraction done, returns `Fitted`.

    Parameters
    ----------
    cage (n, 3) mm : the cage of the warped skin
    faces (m, 4) : its quads
    free (n,) bool : vertices that look for data; the others (mouth bag, lid backs, nostrils) follow smoothly
    rim (n,) bool : vertices that look for data in the last rounds only, and only close by (margins of lips and lids)
    stiffness (n,) : factor on the bending stiffness of each vertex (1 everywhere by default)
    """
    base = np.array(cage, dtype=float)
    n = len(base)
    stiffness = np.ones(n) if stiffness is None else np.array(stiffness, dtype=float)
    bend = laplacian(base, faces)
    stiffness = stiffness * fineness(base, faces)
    surface = drawn_points(faces, free, free | rim)
    held = (anchors.sampling @ surface.rows[:n]).tocsr()
    start = surface.rows @ base
    displacement = np.zeros((n, 3))
    for turn, (soft, reach, width) in enumerate(rounds):
        now = surface.rows @ (base + displacement)
        normal = vertex_normals(now, surface.outer)
        look = np.flatnonzero(surface.seen if soft < LAST else surface.look if soft < FINE else surface.coarse)
        points = surface.between(now)[look]
        found, trust = matches(points, normal[look], target, reach)
        trust[~surface.look[look] & (found.distance > CLOSE)] = 0
        use = np.flatnonzero(trust > 0)
        gap = found.points[use] - points[use]
        # The direction of the data's normal decides; a pinch of the skin's own keeps it calm on rough data.
        facing = found.normals[use] + 0.5 * normal[look[use]]
        facing /= np.linalg.norm(facing, axis=1, keepdims=True)
        height = np.einsum("ij,ij->i", gap, facing)
        robust = trust[use] / (1 + (height / width) ** 2) ** 2
        blocks = robust[:, None, None] * (facing[:, :, None] * facing[:, None, :] + ALONG * np.eye(3))
        rows = surface.rows[look[use]]
        goal = rows @ displacement + gap
        hold = anchors.weight[:, None, None] * np.eye(3)
        want = anchors.target - held @ base
        sampling = vstack([rows, held]).tocsr()
        blocks = np.concatenate([blocks, hold])
        goal = np.concatenate([goal, want])
        pulls = np.einsum("kij,kj->ki", blocks, goal)
        smooth = (bend.T @ diags(soft * stiffness) @ bend + STRETCH * stretch(bend, stiffness)).tocsr()
        displacement = solve_displacement(smooth, sampling, blocks, pulls, displacement)
        worse = folded(start, surface.rows @ (base + displacement), surface.triangles)
        if worse.any():  # hold the surroundings of a fold more stiffly from now on
            at = np.zeros(len(start))
            at[surface.triangles[worse].ravel()] = 1
            near = (surface.rows.T @ at > 0.2).astype(float)
            for _ in range(2):
                near = np.maximum(near, (np.abs(bend) @ near > 0) * 0.9)
            stiffness = stiffness * np.where(near > 0, 6.0, 1.0)
        yield (turn + 1) / len(rounds)
    cage = base + displacement
    now = surface.rows @ cage
    vertices = now[:n]
    normal = vertex_normals(now, surface.outer)[:n]
    found, trust = matches(vertices, normal, target, 3.0)
    trust[~free] = 0
    gap = np.einsum("ij,ij->i", vertices - found.points, found.normals)
    return Fitted(cage, vertices, np.clip(trust, 0, 1), np.where(free & (trust > 0), gap, np.nan))


def fineness(vertices, faces) -> np.ndarray:
    """(n,) factor on the stiffness: the same bend costs as much in a fine mesh as in a coarse one.

    A Laplacian without units sees a bend over short edges as small; small features would be the first to fold.
    """
    a, b = edges(faces).T
    length = np.linalg.norm(vertices[a] - vertices[b], axis=1)
    n = len(vertices)
    count = np.bincount(a, minlength=n) + np.bincount(b, minlength=n)
    mean = (np.bincount(a, length, n) + np.bincount(b, length, n)) / np.maximum(count, 1)
    usual = np.median(mean[count > 0])
    return np.clip((usual / np.maximum(mean, 1e-6)) ** 2, 1.0, FINEST)


def stretch(bend, stiffness):
    """Energy (n, n) of first differences, symmetric, from the Laplacian's own neighbours."""
    link = -(bend - diags(bend.diagonal()))
    link = link.maximum(link.T)
    total = np.asarray(link.sum(axis=1)).ravel()
    return diags(total) - link


def folded(before, after, triangles, limit: float = 0.0):
    """Which triangles (t,) turned over: their normal against what it was is below ``limit`` (cosine)."""

    def unit(points):
        a, b, c = (points[triangles[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)

    return np.einsum("ij,ij->i", unit(before), unit(after)) < limit
