# SPDX-License-Identifier: GPL-3.0-or-later
"""Overlapping views that a scanner did not fuse: laid onto each other, so that where several saw the skin there is one skin.

A scan of several cameras, or of several turns of the head, may come as the sheets that each saw, a millimetre or two apart
where they overlap; a skin fitted to them jumps from one to the next, and wrinkles. They are registered (Besl and McKay 1992,
with the distances to planes of Chen and Medioni 1992, all sheets at once), and what then still differs is averaged along the
normals, each sheet's weight falling to zero toward its border (the consensus geometry of Turk and Levoy 1994, section 5).
Of what several views show the best is kept (their section 4): what counts areas of a scan would count it twice. Lengths are
parts of the scan's size, as its unit is not known yet.
"""

from itertools import permutations
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix, identity
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..adapt.closest import Surface
from ..mesh import vertex_areas, vertex_normals
from ..progress import Progress, Work

LABEL = "Laying the views onto each other"
#: Part of the surface that a piece must have to be a view, and the most views that are looked at.
LARGE, MOST = 0.04, 40
#: How many times as long as wide, and as deep, a scan of somebody from head to foot is, by deviations: by such a measure
#: clothes lie on skin as near as views.
LONG, DEEP = 2.2, 5.0
#: How far apart views may lie, as part of the largest one's diagonal: 4 to 5 mm on a head with its shoulders.
REACH = 0.01
#: Times the reach over which a view counts for less toward its border.
BORDER = 2.0
#: Cosine: what overlaps faces the same way.
ALIKE = 0.7
#: Points of each view that tell how it lies, and rounds of laying them.
SAMPLES, ROUNDS = 2000, 10
#: Share of a view's points that must lie on another one, and of all the surface that must be seen twice.
OVERLAP, TWICE = 0.08, 0.2
#: Part of the reach that views are apart at most, by their median: hair and clothes on skin are farther.
APART = 1 / 2
#: Weight of what a view shows at its very border, where no other one counts.
LEAST = 0.02
#: How much more another view must count, of the most it may, for what shows in this one to be spare: so much may be told
#: otherwise from either's vertices, and what each leaves to the other would be lost.
BETTER = 0.25
#: Rings of triangles by which views still overlap where one takes over from another.
STRIP = 2


class _View(NamedTuple):
    """One piece of a scan: ``at`` (k,) its vertices; ``points`` and ``normals`` (k, 3) of them; what answers where it is
    nearest; ``rim`` the tree of its border, or None; ``inside`` (k,) 0 at its border, 1 away from it."""

    at: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    surface: Surface
    rim: cKDTree | None
    inside: np.ndarray


def laying_together(points: np.ndarray, triangles: np.ndarray, label: np.ndarray) -> Work:
    """Work returning the vertices of a cleaned scan in any unit, its overlapping views laid onto each other, which triangles to
    keep (m,) bool, how many views they are and how far apart they were (median): as it was, all, 0 and 0 where none overlap.

    points (n, 3), triangles (m, 3); label : (n,) the connected piece of each vertex (`clean.components`)
    """
    as_it_is = points, np.ones(len(triangles), dtype=bool), 0, 0.0
    area = np.bincount(label, vertex_areas(points, triangles))
    large = np.argsort(-area)[:MOST]
    large = large[area[large] > LARGE * area.sum()]
    if len(large) < 2 or _is_long(points):
        return as_it_is
    yield Progress(0.0, LABEL)
    reach = REACH * max(np.linalg.norm(np.ptp(points[label == piece], axis=0)) for piece in large)
    large = [piece for piece, near in zip(large, _beside(points, label, large, reach), strict=True) if near]
    if len(large) < 2:
        return as_it_is
    normals = _smooth_normals(points, triangles)
    views = [_view(points, triangles, normals, label == piece, BORDER * reach) for piece in large]
    yield Progress(0.1, LABEL)
    placed, pairs, apart = yield from _registering(views, reach, area[large], area.sum())
    if not pairs:
        return as_it_is
    out, spare = points.copy(), np.zeros(len(points), dtype=bool)
    overlapping = {k for pair in pairs for k in pair}
    for step, k in enumerate(sorted(overlapping)):
        yield Progress(0.7 + 0.3 * step / len(overlapping), LABEL)
        others = [j for i, j in pairs if i == k]
        out[views[k].at], spare[views[k].at] = _consensus(views, placed, k, others, reach)
    for _ in range(STRIP):
        spare[triangles[~spare[triangles].all(axis=1)]] = False
    return out, ~spare[triangles].any(axis=1), len(overlapping), apart


def _is_long(points):
    """Whether the scan lies along a line, or in a plane, as somebody who stands does."""
    some = points[:: max(len(points) // SAMPLES, 1)]
    long, wide, deep = np.linalg.svd(some - some.mean(axis=0), compute_uv=False)
    return long > LONG * wide or long > DEEP * deep


def _beside(points, label, large, reach):
    """(k,) bool: which of the pieces ``large`` (k,) may have another one on them, by some of their vertices; soon told."""
    some = [points[at[:: max(len(at) // SAMPLES, 1)]] for at in (np.flatnonzero(label == piece) for piece in large)]
    trees = [cKDTree(each) for each in some]
    wide = [np.median(tree.query(each, 2)[0][:, 1]) for tree, each in zip(trees, some, strict=True)]
    near = np.zeros(len(large), dtype=bool)
    for i, j in permutations(range(len(large)), 2):
        if np.isfinite(trees[j].query(some[i], distance_upper_bound=2 * (reach + wide[j]))[0]).mean() > OVERLAP:
            near[[i, j]] = True
    return near


def _smooth_normals(points, triangles, rounds=3):
    """(n, 3) unit normals, averaged over neighbours."""
    n = len(points)
    a, b, c = triangles.T
    links = coo_matrix((np.ones(3 * len(a), np.float32), (np.r_[a, b, c], np.r_[b, c, a])), shape=(n, n)).tocsr()
    links = links + links.T + identity(n, np.float32, format="csr")
    normals = vertex_normals(points, triangles)
    for _ in range(rounds):
        normals = links @ normals
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return normals


def _view(points, triangles, normals, own, width) -> _View:
    """The piece of the vertices ``own`` (n,) bool, which counts for less within ``width`` of its border."""
    at = np.flatnonzero(own)
    index = np.cumsum(own) - 1
    surface = Surface(points[at], index[triangles[own[triangles[:, 0]]]])
    surface = Surface(surface.vertices, surface.triangles, 2 * surface.edge_length)
    ends = surface.vertices[surface.border_vertex]
    rim = cKDTree(ends) if len(ends) else None
    return _View(at, points[at], normals[at], surface, rim, _inside(rim, points[at], width))


def _inside(rim, points, width):
    """(k,) 0 at the border, 1 from ``width`` on."""
    if rim is None:
        return np.ones(len(points))
    return np.minimum(rim.query(points, distance_upper_bound=width)[0] / width, 1.0)


def _registering(views, reach, area, whole):
    """Work returning where each view goes, (turn (3, 3), shift (3,)), the pairs (i, j) of views of which i lies on j then, and
    how far apart they were: no pairs unless `TWICE` of the ``whole`` area is seen twice."""
    places = [(np.eye(3), np.zeros(3)) for _ in views]
    step = [slice(None, None, max(len(view.at) // SAMPLES, 1)) for view in views]
    pairs = list(permutations(range(len(views)), 2))
    met = {(i, j): _met(views, places, i, j, step[i], 2 * reach) for i, j in pairs}
    met = {pair: met[pair] for pair in pairs if _lie_on_each_other(met, pair, APART * reach)}
    seen = np.zeros(len(views))
    for i, j in met:
        seen[i] = max(seen[i], _share(met, (i, j)))
    if seen @ area < TWICE * whole:
        return places, [], 0.0
    apart = float(np.median(np.concatenate([np.abs(gap) for _, _, gap, _ in met.values()])))
    middle = np.mean([view.points.mean(axis=0) for view in views], axis=0)
    radius = np.mean([np.linalg.norm(view.points - middle, axis=1).mean() for view in views])
    for turn in range(ROUNDS):
        yield Progress(0.1 + 0.6 * turn / ROUNDS, LABEL)
        places = _stepped(places, met, middle, radius, area)
        within = reach * np.interp(turn, [0, ROUNDS / 2], [2, 1])
        met = {(i, j): _met(views, places, i, j, step[i], within) for i, j in met}
    views_met = sorted({k for pair in met for k in pair})
    met = {(i, j): _met(views, places, i, j, step[i], reach) for i, j in permutations(views_met, 2)}
    return places, [pair for pair in met if len(met[pair][2])], apart


def _lie_on_each_other(met, pair, apart):
    """Whether enough of one of the ``pair`` is on the other one, no more than ``apart`` from it."""
    gap = np.concatenate([met[pair][2], met[pair[::-1]][2]])
    enough = max(_share(met, pair), _share(met, pair[::-1])) > OVERLAP
    return enough and np.median(np.abs(gap)) < apart


def _share(met, pair):
    """Share of the first view's points that lie on the second."""
    return len(met[pair][2]) / met[pair][3]


def _met(views, places, i, j, some, within):
    """Where ``some`` points of view i meet view j: (points (m, 3), normals of j there (m, 3), how far they are above it (m,),
    of how many)."""
    (turn, shift), (other, away) = places[i], places[j]
    points = views[i].points[some] @ turn.T + shift
    normals = views[i].normals[some] @ turn.T
    hit = _about_closest(views[j].surface, (points - away) @ other, within)
    facing = hit.normals @ other.T
    ok = hit.found & ~hit.border & (np.einsum("ij,ij->i", normals, facing) > ALIKE)
    at = hit.points[ok] @ other.T + away
    return points[ok], facing[ok], np.einsum("ij,ij->i", points[ok] - at, facing[ok]), len(points)


def _about_closest(surface: Surface, points, within):
    """The `Contacts` of the triangle that has the nearest of the samples that cover ``surface``: nearly the closest."""
    far, sample = surface.cover.nearest(points, 1, within)
    near = np.flatnonzero(np.isfinite(far[:, 0]))
    owner = surface.cover.owner[sample[near, 0]]
    weights, distance = surface.solid.closest(points, near, owner)
    return surface.contacts(len(points), near, distance, owner, weights)


def _stepped(places, met, middle, radius, area):
    """``places`` after one step of all views toward each other, by least squares of the distances to planes; what nothing tells
    stays, and all of them together, by their ``area``, do."""
    count = 6 * len(places)
    normal, right = np.zeros((count, count)), np.zeros(count)
    for (i, j), (points, facing, gap, _) in met.items():
        lever = np.hstack([np.cross((points - middle) / radius, facing), facing])
        square, pull = lever.T @ lever, lever.T @ gap
        one, two = slice(6 * i, 6 * i + 6), slice(6 * j, 6 * j + 6)
        normal[one, one] += square
        normal[two, two] += square
        normal[one, two] -= square
        normal[two, one] -= square
        right[one] -= pull
        right[two] += pull
    normal[np.diag_indices(count)] += 1e-4 * np.trace(normal) / count * np.repeat(area / area.mean(), 6)
    out = []
    for (turn, shift), move in zip(places, np.linalg.solve(normal, right).reshape(-1, 6), strict=True):
        more = Rotation.from_rotvec(move[:3] / radius).as_matrix()
        out.append((more @ turn, more @ (shift - middle) + middle + move[3:]))
    return out


def _consensus(views, places, k, others, reach):
    """Where the points of view k go, (n, 3): along their normals to where those of all views that saw the place are on
    average; and which of them another one shows better, or as well and comes first (n,) bool."""
    view, (turn, shift) = views[k], places[k]
    points, normals = view.points @ turn.T + shift, view.normals @ turn.T
    total, weight = np.zeros(len(points)), view.inside + LEAST
    spare = np.zeros(len(points), dtype=bool)
    for j in others:
        other, away = places[j]
        local = (points - away) @ other
        hit = views[j].surface.closest(local, reach)
        ok = np.flatnonzero(hit.found & ~hit.border)
        ok = ok[np.einsum("ij,ij->i", normals[ok], hit.normals[ok] @ other.T) > ALIKE]
        inside = _inside(views[j].rim, hit.points[ok], BORDER * reach)
        # What is nearly out of reach counts for nothing: there is no step where it gets out.
        share = inside * np.clip(2 - 2 * hit.distance[ok] / reach, 0, 1)
        total[ok] += share * np.einsum("ij,ij->i", (hit.points[ok] - local[ok]) @ other.T, normals[ok])
        weight[ok] += share
        as_well = (j < k) & (share == 1.0) & (view.inside[ok] == 1.0)
        spare[ok] |= as_well | (share > view.inside[ok] + BETTER)
    return points + (total / weight)[:, None] * normals, spare
