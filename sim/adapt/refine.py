# SPDX-License-Identifier: GPL-3.0-or-later
"""Refinement of the landmark sets on source and target (Kähler et al. 2002, section 6.2 and table 1)."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..mesh import surface_points
from .closest import Surface
from .feature_mesh import describe, filtered_normals, flip_edges, place, subdivide
from .thin_plate_spline import ThinPlateSpline

ROUNDS = 3
AGREE = 0.55  # cosine: a sampling site must face the way the feature mesh does
AGREE_NEAREST = 0.75  # the same for sites that no ray met (islands of data)
GIVE = 0.4  # mm: smoothing of the warp, so that two landmarks close together do not tear the space between them


@dataclass(frozen=True, eq=False)
class Pairs:
    """Landmarks on the source (k, 3) and on the target (k, 3), mm, and how much each may give way (k,), mm.

    The first ``marks`` of them are the vertices of the feature mesh.
    """

    source: np.ndarray
    target: np.ndarray
    give: np.ndarray
    marks: int


def sampling_sites(points, normals, target: Surface, reach):
    """A place on the target for each new vertex, where there is a good one.

    Along the filtered normal, both ways, every crossing is a candidate; those that look another way (back faces too) or
    touch an open side of the data are rejected; the others are ranked by distance and agreement of normals. Where the
    line meets no data, the nearest data that faces the same way is tried: small islands are found like that.

    points (k, 3), normals (k, 3), reach (k,) mm -> found (k,) bool, places (k, 3)
    """
    found, places = np.zeros(len(points), dtype=bool), np.array(points, dtype=float)
    line, t, triangle, weights = target.crossings(points, normals, float(reach.max()))
    corner = target.triangles[triangle]
    normal = np.einsum("kij,ki->kj", target.normals[corner], weights)
    agree = np.einsum("ij,ij->i", normal, normals[line]) / np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
    good = (agree > AGREE) & (np.abs(t) <= reach[line]) & ~target.border_vertex[corner].any(axis=1)
    pick = np.flatnonzero(good)
    cost = np.abs(t[pick]) * (1 + 2 * (1 - agree[pick]))
    pick = pick[np.lexsort((cost, line[pick]))]
    at, first = np.unique(line[pick], return_index=True)
    pick = pick[first]
    found[at] = True
    places[at] = surface_points(target.vertices, corner[pick], weights[pick])
    rest = np.flatnonzero(~found)
    if len(rest):
        near = target.ranked(points[rest], normals[rest], float(reach.max()) * 0.6, AGREE_NEAREST)
        ok = near.found & ~near.border & (near.distance < 0.6 * reach[rest])
        found[rest[ok]] = True
        places[rest[ok]] = near.points[ok]
    return found, places


def on_source(points, normals, source: Surface, reach):
    """The nearest crossing of the source for each point, facing forward; the nearest point where no line meets it."""
    line, _, triangle, weights = source.crossings(points, normals, reach)
    corner = source.triangles[triangle]
    normal = np.einsum("kij,ki->kj", source.normals[corner], weights)
    pick = np.flatnonzero(np.einsum("ij,ij->i", normal, normals[line]) > 0.2)  # ordered by distance already
    at, first = np.unique(line[pick], return_index=True)
    pick = pick[first]
    found, places = np.zeros(len(points), dtype=bool), np.array(points, dtype=float)
    found[at] = True
    places[at] = surface_points(source.vertices, corner[pick], weights[pick])
    return found, places


def refine(skin, outer, target: Surface, feature_mesh, pairs: Pairs, rounds: int = ROUNDS):
    """Table 1 from "repeat" on; a generator that yields (fraction, pairs) per round and returns the list of warps.

    Parameters
    ----------
    skin : (n, 3) mm, the skin already warped by the given landmarks
    outer : (t, 3) triangles of the skin that a scanner can see
    feature_mesh : (f, 3) over the landmarks in ``pairs``; ``pairs.source`` lies on the skin as warped
    """
    triangles = np.asarray(feature_mesh, dtype=np.int32)
    skin = np.array(skin, dtype=float)
    landmark_s, landmark_t, give = pairs.source.copy(), pairs.target.copy(), pairs.give.copy()
    shape_s, shape_t = pairs.source[: pairs.marks].copy(), pairs.target[: pairs.marks].copy()  # F and F*
    warps = []
    for turn in range(rounds):
        source = Surface(skin, outer)
        normal = filtered_normals(shape_t, triangles)
        parents, old = triangles, len(shape_t)
        middle = shape_t[parents].mean(axis=1)
        size = np.sqrt(np.linalg.norm(shape_t[parents] - middle[:, None], axis=2).max(axis=1) ** 2 + 1e-12)
        # The first triangles are long chords across the face, the data may be far from them; later ones lie close.
        reach = np.clip(0.9 * size, 4.0, 40.0 if turn == 0 else 15.0)
        start_found, start = on_source(middle, normal, source, float(reach.max()))
        # Look from the source's surface: it is the best guess where the data should be.
        limit = np.clip(0.5 * size, 3.0, 14.0 if turn == 0 else 7.0)
        found, places = sampling_sites(start, normal, target, limit)
        found &= start_found
        places = np.where(found[:, None], places, start)
        weights, height = describe(shape_t, parents, places)
        sane = (weights > -0.35).all(axis=1)
        found &= sane
        places = np.where(sane[:, None], places, middle)
        weights, height = describe(shape_t, parents, places)
        triangles = subdivide(parents, old)
        shape_t = np.concatenate([shape_t, places])
        copied = place(shape_s, parents, weights, height)
        hit, foot = on_source(copied, filtered_normals(shape_s, parents), source, float(limit.max()) + 4.0)
        add = found & hit & (np.linalg.norm(foot - places, axis=1) < 2 * limit)
        shape_s = np.concatenate([shape_s, np.where(hit[:, None], foot, copied)])
        triangles = flip_edges(triangles, old, shape_s, shape_t)
        landmark_s = np.concatenate([landmark_s, foot[add]])
        landmark_t = np.concatenate([landmark_t, places[add]])
        give = np.concatenate([give, np.full(int(add.sum()), GIVE)])
        keep = thinned(landmark_s, 1.2)
        warp = ThinPlateSpline.fit(landmark_s[keep], landmark_t[keep], give[keep])
        warps.append(warp)
        skin, shape_s = warp.transform(skin), warp.transform(shape_s)
        landmark_s = warp.transform(landmark_s)
        # Where there was no data both feature meshes follow the source.
        free = np.ones(len(shape_t), dtype=bool)
        free[:old] = False
        free[old:][found] = False
        shape_t[free] = shape_s[free]
        yield (turn + 1) / rounds, int(add.sum())
    return warps


def thinned(points, gap):
    """Indices of points of which no earlier one is nearer than ``gap`` mm (greedy, in order); for small gaps."""
    near = cKDTree(points).query_pairs(gap, output_type="ndarray")
    keep = np.ones(len(points), dtype=bool)
    for i, j in near[np.lexsort((near[:, 1], near[:, 0]))]:
        if keep[i]:
            keep[j] = False
    return np.flatnonzero(keep)


def scattered(points, gap):
    """Indices of one point for each cube of ``gap`` mm that holds any: the one nearest to the cube's middle."""
    cell = np.floor(points / gap)
    off = np.linalg.norm(points / gap - cell - 0.5, axis=1)
    order = np.lexsort((off, *cell.T))
    _, first = np.unique(cell[order], axis=0, return_index=True)
    return np.sort(order[first])
