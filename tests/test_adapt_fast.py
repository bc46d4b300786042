# SPDX-License-Identifier: GPL-3.0-or-later
"""What makes adaptation fast changes nothing: against brute force, in blocks of any size, twice the same."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.distance import cdist

from headshop.sim import box_tree, triangle_projection
from headshop.sim.adapt import closest, thin_plate_spline
from headshop.sim.adapt.closest import Surface
from headshop.sim.adapt.ranking import least
from headshop.sim.adapt.scan_surface import scan_surface
from headshop.sim.adapt.thin_plate_spline import ThinPlateSpline
from headshop.sim.mesh import Mesh
from headshop.sim.triangle_projection import Triangles, closest_on_triangles


@pytest.fixture
def uneven():
    """A ball with triangles of very different sizes, and points on, near and far from it."""
    rng = np.random.default_rng(4)
    points = rng.normal(size=(700, 3)) * [1, 1, 0.2] + np.array([[0, 0, 0.9]]) * (rng.random((700, 1)) > 0.4)
    points = 80 * points / np.linalg.norm(points, axis=1, keepdims=True)
    hull = ConvexHull(points)
    a, b, c = (points[hull.simplices[:, k]] for k in range(3))
    out = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) > 0
    triangles = np.where(out[:, None], hull.simplices, hull.simplices[:, ::-1])
    queries = np.concatenate([rng.normal(0, 60, (60, 3)), a[:60], (a + b + c)[:60] / 3, [[0, 0, 0.0]]])
    return Surface(points, triangles), queries


def every_pair(surface, queries):
    """Distance (k, m) and weights (k, m, 3) from each query to each triangle."""
    k, m = len(queries), len(surface.triangles)
    row, owner = np.repeat(np.arange(k), m), np.tile(np.arange(m), k)
    weights, distance = closest_on_triangles(queries[row], *surface.corners[owner].transpose(1, 0, 2))
    return distance.reshape(k, m), weights.reshape(k, m, 3)


def test_pairs_agree_with_dense_sampling():
    rng = np.random.default_rng(0)
    corners = rng.normal(0, 5, (40, 3, 3))
    corners[0, 2] = corners[0, 1]  # a line
    p = rng.normal(0, 8, (40, 3))
    weights, distance = closest_on_triangles(p, *corners.transpose(1, 0, 2))
    share = rng.dirichlet(np.full(3, 0.7), 4000)
    share = np.concatenate([share, np.eye(3), *[np.roll(np.stack([s, 1 - s, 0 * s], 1), k, 1) for k in range(3)
                                                  for s in [np.linspace(0, 1, 400)]]])  # fmt: skip
    sampled = np.linalg.norm(np.einsum("sk,mkx->msx", share, corners) - p[:, None], axis=2).min(axis=1)
    assert (distance <= sampled + 1e-9).all() and (sampled - distance < 0.2).all()
    at = np.einsum("mk,mkx->mx", weights, corners)
    np.testing.assert_allclose(np.linalg.norm(at - p, axis=1), distance, atol=1e-9)
    assert (weights > -1e-12).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1)


def test_blocks_of_pairs_change_nothing(monkeypatch):
    rng = np.random.default_rng(1)
    corners, points = rng.normal(0, 5, (300, 3, 3)), rng.normal(0, 8, (50, 3))
    row, owner = rng.integers(0, 50, 999), rng.integers(0, 300, 999)
    whole = Triangles(corners).closest(points, row, owner)
    single = closest_on_triangles(points[row], *corners[owner].transpose(1, 0, 2))
    monkeypatch.setattr(triangle_projection, "BLOCK", 7)
    for one, two, three in zip(whole, Triangles(corners).closest(points, row, owner), single, strict=True):
        np.testing.assert_array_equal(one, two)
        np.testing.assert_array_equal(one, three)


@pytest.mark.parametrize("reach", [np.inf, 30.0])
def test_closest_is_the_closest_of_all(uneven, reach, monkeypatch):
    surface, queries = uneven
    brute = every_pair(surface, queries)[0].min(axis=1)
    found = surface.closest(queries, reach)
    np.testing.assert_array_equal(found.found, brute <= reach)
    np.testing.assert_allclose(found.distance[found.found], brute[brute <= reach], atol=1e-9)
    monkeypatch.setattr(closest, "BATCH", 5)
    monkeypatch.setattr(box_tree, "POINTS", 3)
    again = surface.closest(queries, reach)
    np.testing.assert_array_equal(found.distance, again.distance)


def test_ranking_is_that_of_all_the_triangles_near(uneven):
    surface, queries = uneven
    rng = np.random.default_rng(2)
    normals = rng.normal(size=queries.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    found = surface.ranked(queries, normals, 90.0, 0.4, near=10**6, bend=1.5)
    distance, weights = every_pair(surface, queries)
    normal = np.einsum("kmc,mcx->kmx", weights, surface.normals[surface.triangles])
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    cosine = np.einsum("kmx,kx->km", normal, normals)
    cost = np.where((cosine >= 0.4) & (distance <= 90.0), distance * (1 + 1.5 * (1 - cosine)), np.inf)
    np.testing.assert_array_equal(found.found, np.isfinite(cost.min(axis=1)))
    rows = np.flatnonzero(found.found)
    assert len(rows) > 50
    np.testing.assert_allclose(cost[rows, found.triangle[rows]], cost[rows].min(axis=1), atol=1e-9)


def test_lines_through_a_closed_surface_cross_it_twice(uneven):
    surface, _ = uneven
    rng = np.random.default_rng(3)
    origins, ways = rng.normal(0, 5, (40, 3)) + [0, 0, 25], rng.normal(size=(40, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    line, t, _, _ = surface.crossings(origins, ways, 200.0)
    np.testing.assert_array_equal(line, np.repeat(np.arange(40), 2))
    assert (t[::2] * t[1::2] < 0).all()


def test_the_least_of_each_row_and_the_first_of_equals():
    row, cost = np.array([0, 0, 2, 2, 2, 5]), np.array([3.0, 1.0, 4.0, 2.0, 2.0, np.inf])
    np.testing.assert_array_equal(least(row, cost), [[0, 2, 5], [1, 3, 5]])
    assert len(least(row[:0], cost[:0])[0]) == 0


def test_the_same_twice(uneven):
    surface, queries = uneven
    again = Surface(surface.vertices, surface.triangles)
    for name, value in vars(surface.closest(queries)).items():
        np.testing.assert_array_equal(value, getattr(again.closest(queries), name))


def sheet(size, steps, z=0.0, up=True):
    """A square of ``size`` mm in 2 steps² triangles at height z."""
    side = np.linspace(0, size, steps + 1)
    x, y = np.meshgrid(side, side, indexing="ij")
    i = np.arange((steps + 1) ** 2).reshape(steps + 1, steps + 1)
    a, b, c, d = (k.ravel() for k in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return np.stack([x, y, np.full_like(x, z)], -1).reshape(-1, 3), triangles if up else triangles[:, ::-1]


def test_a_dense_surface_thinned_lies_where_it_lay():
    (top, t), (low, u) = sheet(60, 80, 0.05), sheet(60, 80, -0.05, up=False)
    both = Surface(np.concatenate([top, low]), np.concatenate([t, u + len(top)]))
    assert both.coarser(len(both.triangles)) is both
    thin = both.coarser(3000)
    assert 1000 < len(thin.triangles) <= 3600
    np.testing.assert_allclose(np.abs(thin.vertices[:, 2]), 0.05)  # sheets that face each other stay apart
    assert thin.area.sum() == pytest.approx(2 * 60**2, rel=0.08)
    assert np.isin(np.round(thin.face_normals[:, 2], 9), [-1, 1]).all()
    inside = (np.abs(thin.vertices[:, :2] - 30) < 27).all(axis=1)
    assert not thin.border_vertex[inside].any()  # no cracks
    again = both.coarser(3000)
    np.testing.assert_array_equal(thin.vertices, again.vertices)
    np.testing.assert_array_equal(thin.triangles, again.triangles)


def test_only_the_head_of_a_large_scan_is_looked_at(reference):
    head = reference.skin
    marks = reference.landmark_positions()
    given = {name: marks[name] for name in ("ex_l", "ex_r", "prn", "gn", "t_l")}

    def before_wall(size):
        wall, triangles = sheet(size, 60, -400.0)
        return Mesh.from_triangles(
            np.concatenate([head.vertices, wall - [size / 2, size / 2, 0]]),
            np.concatenate([head.triangles, triangles + len(head.vertices)]),
        )

    scan = before_wall(800)  # no larger than a bust
    assert len(scan_surface(reference, scan, given).triangles) == len(scan.triangles)
    scan = before_wall(1500)
    assert len(scan_surface(reference, scan, given).triangles) == len(head.triangles)
    some = scan_surface(reference, scan, given, most=len(head.triangles))
    assert some.vertices[:, 2].min() > -300 and len(some.triangles) == len(head.triangles)
    thin = scan_surface(reference, scan, given, most=2000)
    assert len(thin.triangles) < 2600 and thin.closest(head.vertices).distance.mean() < 1.5
    elsewhere = {name: place + [5000, 0, 0] for name, place in given.items()}
    assert np.ptp(scan_surface(reference, scan, elsewhere, most=12000).vertices, axis=0).max() == pytest.approx(1500)


def test_a_surface_turned_is_that_of_triangles_turned(uneven):
    surface, queries = uneven
    # Its normals asked for before and after: neither may matter.
    other = Surface(surface.vertices, surface.triangles[:, ::-1])
    np.testing.assert_allclose(surface.normals, -other.normals, atol=1e-12)
    for one in (surface.turned(), Surface(surface.vertices, surface.triangles).turned()):
        np.testing.assert_allclose(one.normals, other.normals, atol=1e-12)
        np.testing.assert_allclose(one.face_normals, other.face_normals, atol=1e-12)
        mine, theirs = one.closest(queries), other.closest(queries)
        np.testing.assert_allclose(mine.distance, theirs.distance, atol=1e-12)
        np.testing.assert_allclose(mine.points, theirs.points, atol=1e-9)


def test_boxes_near_points_are_all_found(monkeypatch):
    rng = np.random.default_rng(7)
    for count in (1, 5, 300):
        low = rng.normal(0, 40, (count, 3))
        high = low + rng.uniform(0, 10, (count, 3))
        points, reach = rng.normal(0, 50, (40, 3)), rng.uniform(0, 40, 40)
        gap = np.maximum(np.maximum(low[None] - points[:, None], points[:, None] - high[None]), 0)
        row, box = box_tree.BoxTree(low, high).near(points, reach)
        wanted = np.argwhere(np.linalg.norm(gap, axis=2) <= reach[:, None])
        np.testing.assert_array_equal(sorted(zip(row.tolist(), box.tolist(), strict=True)), wanted)
        assert (np.diff(row) >= 0).all()
    assert len(box_tree.BoxTree(low, high).near(np.zeros((0, 3)), np.zeros(0))[0]) == 0


def test_thousands_of_landmarks_are_warped_in_small_tables(monkeypatch):
    rng = np.random.default_rng(8)
    source, points = rng.normal(0, 60, (1500, 3)), rng.normal(0, 80, (4000, 3))
    target = source + 5 * np.sin(source / 30)
    whole = ThinPlateSpline.fit(source, target, 0.1).transform(points)
    sizes = []

    def recorded(a, b):
        sizes.append(len(a) * len(b))
        return cdist(a, b)

    monkeypatch.setattr(thin_plate_spline, "cdist", recorded)
    monkeypatch.setattr(thin_plate_spline, "BLOCK", 50_000)
    warp = ThinPlateSpline.fit(source, target, 0.1)
    np.testing.assert_allclose(warp.transform(points), whole, atol=1e-9)
    assert max(sizes) <= 50_000 and sum(sizes) == 1500 * (1500 + 4000)


def test_a_surface_is_told_from_one_turned_inside_out(uneven):
    surface, queries = uneven
    out = queries[60:120]  # corners of it
    facing, turned = (of.facing(out, 20.0) for of in (surface, surface.turned()))
    assert np.median(np.einsum("ij,ij->i", facing, out)) > 0 > np.median(np.einsum("ij,ij->i", turned, out))
    assert not surface.inside_out(out, out, 20.0) and surface.turned().inside_out(out, out, 20.0)
    far = out + 5000
    assert not surface.facing(far, 20.0).any() and not surface.turned().inside_out(far, out, 20.0)
