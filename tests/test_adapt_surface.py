# SPDX-License-Identifier: GPL-3.0-or-later
"""Closest points, rays, feature meshes: exact on cases small enough to know the answer."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from headshop.sim.adapt.closest import Surface, weld
from headshop.sim.adapt.feature_mesh import describe, flip_edges, place, subdivide
from headshop.sim.adapt.refine import sampling_sites, scattered, thinned
from headshop.sim.triangle_projection import closest_on_triangles


def ball(radius=100.0, count=3000, seed=0):
    """Triangles of a sphere, outside out."""
    points = np.random.default_rng(seed).normal(size=(count, 3))
    points *= radius / np.linalg.norm(points, axis=1, keepdims=True)
    return points, convex(points)


def convex(points):
    """Triangles of the convex hull about the origin, outside out."""
    faces = ConvexHull(points).simplices
    normal = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    inward = (normal * points[faces].mean(axis=1)).sum(axis=1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return faces


def test_closest_point_of_one_triangle():
    a, b, c = np.array([[0, 0, 0.0]]), np.array([[2, 0, 0.0]]), np.array([[0, 2, 0.0]])
    cases = {
        (0.5, 0.5, 3.0): ((0.5, 0.25, 0.25), 3.0),  # over the inside
        (-1.0, -1.0, 0.0): ((1, 0, 0), np.sqrt(2)),  # corner
        (1.0, -2.0, 0.0): ((0.5, 0.5, 0), 2.0),  # side
        (2.0, 2.0, 0.0): ((0, 0.5, 0.5), np.sqrt(2)),  # long side
    }
    for point, (weights, distance) in cases.items():
        found, gap = closest_on_triangles(np.array([point]), a, b, c)
        np.testing.assert_allclose(found[0], weights, atol=1e-12)
        assert gap[0] == pytest.approx(distance)


def test_closest_is_exact_on_uneven_triangles():
    points, faces = ball(count=100)
    fine, more = ball(60.0, 900, seed=1)  # triangles of very different size in one surface
    vertices = np.concatenate([points, fine + [150.0, 0, 0]])
    faces = np.concatenate([faces, more + len(points)])
    rng = np.random.default_rng(2)
    queries = rng.normal(0, 90, (100, 3)) + [60.0, 0, 0]
    found = Surface(vertices, faces).closest(queries)
    corners = vertices[faces]
    for start in range(0, 100, 50):
        q = queries[start : start + 50]
        flat = np.repeat(q, len(faces), axis=0)
        a, b, c = (np.tile(corners[:, k], (50, 1)) for k in range(3))
        brute = closest_on_triangles(flat, a, b, c)[1].reshape(50, -1).min(axis=1)
        np.testing.assert_allclose(found.distance[start : start + 50], brute, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(found.points - queries, axis=1), found.distance, atol=1e-9)


def test_reach_limits_and_open_sides_are_told():
    side = np.linspace(0, 100, 21)
    x, y = np.meshgrid(side, side, indexing="ij")
    points = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    i = np.arange(441).reshape(21, 21)
    quads = np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]], axis=-1).reshape(-1, 4)
    surface = Surface(points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    found = surface.closest(np.array([[50.0, 50.0, 4.0], [50.0, 50.0, 40.0], [130.0, 50.0, 0.0]]), reach=35.0)
    np.testing.assert_array_equal(found.found, [True, False, True])
    np.testing.assert_array_equal(found.border, [False, False, True])
    np.testing.assert_allclose(found.normals[0], [0, 0, 1])
    turned = surface.turned().closest(np.array([[50.0, 50.0, 4.0]]))
    np.testing.assert_allclose(turned.normals[0], [0, 0, -1])


def scanned_ball(radius=30.0, count=4000):
    """A sphere's triangles about as even as a scanner's, its points along a spiral: sides of about 1.8 mm."""
    z = 1 - (2 * np.arange(count) + 1) / count
    turn = np.pi * (1 + 5**0.5) * np.arange(count)
    points = radius * np.stack([*(np.sqrt(1 - z**2) * [np.cos(turn), np.sin(turn)]), z], axis=1)
    return points, convex(points)


@pytest.mark.parametrize("share", [0.05, 0.15, 0.3])
def test_single_triangles_that_are_missing_end_no_data(share):
    points, faces = scanned_ball()
    there = np.random.default_rng(3).random(len(faces)) >= share
    assert Surface(points, faces[there]).border_vertex.mean() < 0.005
    up = points[faces][:, :, 2].min(axis=1) > 0
    half, ragged = Surface(points, faces[up]), Surface(points, faces[up & there])
    low = ragged.vertices[:, 2] < 8
    assert ragged.border_vertex[~low].mean() < 0.005
    assert ragged.border_vertex[low].sum() > 0.8 * half.border_vertex.sum()


@pytest.mark.parametrize(("radius", "ends"), [(2.0, 0.0), (5.0, 0.9), (12.0, 0.95)])
def test_a_hole_ends_data_if_it_is_wider_than_two_triangles(radius, ends):
    points, faces = scanned_ball()
    away = np.linalg.norm(points[faces].mean(axis=1) - [30.0, 0, 0], axis=1)
    hole = Surface(points, faces[away > radius])
    rim = np.linalg.norm(hole.vertices - [30.0, 0, 0], axis=1) < radius + 2.5
    a, b, count = hole._sides
    on_rim = np.unique(np.concatenate([a[count == 1], b[count == 1]]))
    assert rim[on_rim].all()
    assert ends <= hole.border_vertex[on_rim].mean() <= (1.0 if ends else 0.0)


def test_rays_meet_the_sphere_twice():
    surface = Surface(*ball(count=4000))
    rng = np.random.default_rng(3)
    origins = rng.uniform(-30, 30, (50, 3))
    ways = rng.normal(size=(50, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    line, t, triangle, weights = surface.crossings(origins, ways, 200.0)
    assert len(line) == 100
    hits = origins[line] + t[:, None] * ways[line]
    np.testing.assert_allclose(np.linalg.norm(hits, axis=1), 100, atol=0.3)
    on = np.einsum("kij,ki->kj", surface.vertices[surface.triangles[triangle]], weights)
    np.testing.assert_allclose(on, hits, atol=1e-6)
    near, _, _, _ = surface.crossings(origins, ways, 20.0)
    assert len(near) == 0


def test_ranking_prefers_what_faces_the_same_way():
    """Two parallel sheets, the nearer one turned away."""
    square = np.array([[0, 0, 0], [60, 0, 0], [60, 60, 0], [0, 60, 0.0]])
    vertices = np.concatenate([square + [0, 0, 2.0], square + [0, 0, -5.0]])
    surface = Surface(vertices, np.array([[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]))
    at, up = np.array([[30.0, 25.0, 0.0]]), np.array([[0, 0, 1.0]])
    assert surface.closest(at).points[0, 2] == 2
    assert surface.ranked(at, up, 20.0).points[0, 2] == -5
    assert not surface.ranked(at, np.array([[1.0, 0, 0]]), 20.0).found[0]


def test_weld_closes_texture_seams():
    points, faces = ball(count=500)
    split = points[faces].reshape(-1, 3)
    vertices, triangles = weld(split, np.arange(len(split)).reshape(-1, 3))
    assert len(vertices) == len(points) and len(triangles) == len(faces)
    assert not Surface(split, np.arange(len(split)).reshape(-1, 3)).border_vertex.any()


def _tent():
    points = np.array([[0, 0, 0], [10, 0, 1], [10, 10, 0], [0, 10, 2.0]])
    return points, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)


def test_displacements_replay_on_the_same_mesh():
    points, triangles = _tent()
    new = np.array([[6.0, 3.0, 5.0], [3.0, 7.0, -2.0]])
    weights, height = describe(points, triangles, new)
    np.testing.assert_allclose(place(points, triangles, weights, height), new, atol=1e-12)
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    twice = place(2 * points, triangles, weights, 2 * height)
    np.testing.assert_allclose(twice, 2 * new, atol=1e-12)


def test_one_vertex_per_triangle_and_flipped_edges():
    points, triangles = _tent()
    finer = subdivide(triangles, 4)
    assert finer.shape == (6, 3) and set(finer.max(axis=1)) <= {4, 5}
    shape = np.concatenate([points, points[triangles].mean(axis=1)])
    flipped = flip_edges(finer, 4, shape)
    edges = {tuple(sorted(e)) for t in flipped for e in (t[:2], t[1:], t[[2, 0]])}
    assert (0, 2) not in edges and (4, 5) in edges  # the old edge went, the new vertices are joined
    assert len(flipped) == 6
    folded = shape.copy()
    folded[4], folded[5] = [-10.0, -11.0, 0.0], [-11.0, -10.0, 0.0]
    assert flip_edges(finer, 4, folded).tolist() == finer.tolist()  # a flip that turns a triangle over is not made


def test_sampling_rejects_backs_borders_and_what_is_far():
    points, faces = ball(count=4000)
    keep = points[faces].mean(axis=1)[:, 2] > 0  # a bowl: open along the equator
    bowl = Surface(points, faces[keep])
    probe = np.array([[0, 0, 103.0], [0, 0, 160.0], [99.0, 0, 2.0]])
    out = probe / np.linalg.norm(probe, axis=1, keepdims=True)
    found, places = sampling_sites(probe, out, bowl, np.full(3, 8.0))
    np.testing.assert_array_equal(found, [True, False, False])
    np.testing.assert_allclose(np.linalg.norm(places[0]), 100, atol=0.3)
    inside, _ = sampling_sites(probe[:1], -out[:1], bowl, np.full(1, 8.0))
    assert not inside[0]


def test_islands_of_data_are_found():
    points, faces = scanned_ball(100.0, 16000)
    away = np.linalg.norm(points[faces].mean(axis=1) - [0, 0, 100.0], axis=1)
    island = (away > 5) & (away < 15)
    found, places = sampling_sites(
        np.array([[0, 0, 101.0]]), np.array([[0, 0, 1.0]]), Surface(points, faces[island]), np.full(1, 30.0)
    )
    # The line through the hole meets nothing and the hole's rim is no place to trust.
    assert not found[0] or np.linalg.norm(places[0][:2]) > 3


def test_thinning_keeps_the_first_of_close_points():
    points = np.array([[0, 0, 0], [0.5, 0, 0], [3, 0, 0], [3.2, 0, 0.0]])
    np.testing.assert_array_equal(thinned(points, 1.0), [0, 2])
    many = np.random.default_rng(0).uniform(0, 50, (2000, 3))
    pick = scattered(many, 10.0)
    assert 100 < len(pick) <= 216 and len(np.unique(np.floor(many[pick] / 10), axis=0)) == len(pick)


@pytest.mark.parametrize("thick", [3.0, 8.0])
@pytest.mark.parametrize("depth", [0.2, 0.8])
def test_the_outer_wall_of_a_shell_tells_which_side_is_out(thick, depth):
    """Of a hollow print, wound either way, also to a skin that lies nearer to the inner wall."""
    outer, triangles = ball()
    inner, skin = outer * (1 - thick / 100), outer * (1 - depth * thick / 100)
    walls = np.concatenate([triangles, triangles[:, ::-1] + len(outer)])
    shell = Surface(np.concatenate([outer, inner]), walls)
    assert not shell.inside_out(skin, outer / 100, 15.0) and shell.turned().inside_out(skin, outer / 100, 15.0)
    single = Surface(outer, triangles)
    assert not single.inside_out(skin, outer / 100, 15.0) and single.turned().inside_out(skin, outer / 100, 15.0)
