# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures on a scan: what they show at its vertices and between them, and that cleaning keeps them in place."""

from dataclasses import replace

import numpy as np
import pytest

from headshop.sim.mesh import Mesh
from headshop.sim.scan.clean import clean_scan
from headshop.sim.scan.texture import has_pictures, strewn, texel_size, triangle_corners, vertex_colours

RED, GREEN, BLUE, WHITE = ((255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255))


def _picture(*rows):
    return np.array(rows, dtype=np.uint8)


def _square(picture, side=10.0):
    """A quad, ``side`` mm wide, that shows all of ``picture``."""
    corners = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    points = np.column_stack([side * corners, np.zeros(4)])
    faces, uv = np.array([[0, 1, 2, 3]], np.int32), corners[None].astype(np.float32)
    return Mesh(points, faces, uv=uv, material=np.zeros(1, np.int16), pictures=(picture,))


def test_the_triangles_of_a_quad_keep_its_corners():
    uv, material = triangle_corners(_square(_picture([RED])))
    np.testing.assert_array_equal(uv, [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]])
    np.testing.assert_array_equal(material, [0, 0])


def test_points_between_vertices_show_what_the_picture_does_there():
    square = _square(np.kron(_picture([RED, GREEN], [BLUE, WHITE]), np.ones((16, 16, 1), np.uint8)))
    points, normals, colour = strewn(square, 0.5, np.ones(2, dtype=bool))
    np.testing.assert_allclose(normals, np.tile([0, 0, 1.0], (len(points), 1)))
    left, low = points[:, 0] < 5, points[:, 1] < 5
    inside = (np.abs(points[:, :2] - 5) > 1).all(axis=1) & (np.abs(points[:, :2] - 5) < 4).all(axis=1)
    for where, wanted in ((left & low, RED), (~left & low, GREEN), (left & ~low, BLUE), (~left & ~low, WHITE)):
        assert (inside & where).sum() > 20
        np.testing.assert_allclose(
            colour[inside & where], np.tile(wanted, ((inside & where).sum(), 1)) / 255, atol=1e-6
        )


def test_points_are_as_near_each_other_as_asked_and_cover_every_triangle_evenly():
    points, _, _ = strewn(_square(_picture([RED])), 0.5, np.ones(2, dtype=bool))
    count = len(strewn(_square(_picture([RED])), 0.5, np.array([True, False]))[0])
    assert len(points) == 2 * count == pytest.approx(10 * 10 / 0.5**2, rel=0.2)
    filled, _, _ = np.histogram2d(*points[:, :2].T, bins=5, range=[[0, 10]] * 2)
    assert filled.min() > 0.7 * filled.mean() and filled.max() < 1.3 * filled.mean()


def test_along_a_slender_triangle_points_are_not_far_apart():
    points = np.array([[0.0, 0, 0], [30, 0, 0], [30, 0.1, 0]])
    uv = np.array([[[0.0, 0], [1, 0], [1, 1], [0, 0]]], np.float32)
    faces, material = np.array([[0, 1, 2, -1]], np.int32), np.zeros(1, np.int16)
    needle = Mesh(points, faces, uv=uv, material=material, pictures=(_picture([RED]),))
    places = np.sort(strewn(needle, 0.5, np.ones(1, dtype=bool))[0][:, 0])
    assert np.diff(places).max() < 3 * 0.5


def test_texels_are_as_large_as_they_lie_on_the_scan():
    square = _square(np.zeros((20, 40, 3), np.uint8))
    assert texel_size(square, np.ones(2, dtype=bool)) == pytest.approx(np.sqrt(10 / 20 * 10 / 40))


def test_vertices_on_a_seam_take_the_mean_and_those_without_a_picture_keep_their_own():
    one = _square(_picture([RED, GREEN]))
    points = np.concatenate([one.vertices, one.vertices + [10, 0, 0]])
    faces = np.array([[0, 1, 2, 3], [1, 5, 6, 2], [4, 5, 6, 7]], np.int32)
    uv = np.concatenate(
        [np.tile(np.float32([0.25, 0.5]), (1, 4, 1)), np.tile(np.float32([0.75, 0.5]), (1, 4, 1)), one.uv]
    )
    own = np.tile(np.float32([0.2, 0.4, 0.6]), (8, 1))
    mesh = Mesh(
        points, faces, uv=uv, material=np.array([0, 0, 1], np.int16), colour=own, pictures=(*one.pictures, None)
    )
    colour = vertex_colours(mesh)
    np.testing.assert_allclose(colour[[0, 3]], [[1, 0, 0]] * 2, atol=1e-6)
    assert ((colour[[1, 2], :2] > 0.2) & (colour[[1, 2], :2] < 0.8)).all()
    np.testing.assert_allclose(colour[[4, 7]], own[:2])


def test_a_mesh_is_without_pictures_where_it_has_no_place_on_them_or_none():
    square = _square(_picture([RED]))
    assert has_pictures(square)
    assert not has_pictures(replace(square, pictures=(None,)))
    assert not has_pictures(replace(square, uv=None))


def test_cleaning_keeps_every_triangle_where_it_is_on_the_picture():
    """Vertices welded, faces dropped and turned: each triangle that is left shows what it did."""
    rng = np.random.default_rng(1)
    side = np.arange(12.0)
    grid = np.stack([*np.meshgrid(side, side), rng.uniform(0, 3, (12, 12))], axis=-1).reshape(-1, 3)
    corner = np.arange(144).reshape(12, 12)
    quads = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]], axis=-1).reshape(-1, 4)
    split = np.arange(quads.size).reshape(-1, 4)  # every quad has vertices of its own, as along seams
    points, uv = grid[quads.ravel()], (grid[quads][:, :, :2] / 11).astype(np.float32)
    split[::5] = split[::5, ::-1]  # wound the other way
    uv[::5] = uv[::5, ::-1]
    points[split[7]] = np.nan
    mesh = Mesh(
        points,
        split.astype(np.int32),
        uv=uv,
        material=np.zeros(len(split), np.int16),
        pictures=(_picture([RED, GREEN]),),
    )
    clean, counts = clean_scan(mesh)
    assert counts["turned_faces"] > 10 and counts["welded_vertices"] > 300 and counts["nonfinite_faces"] == 2
    corners, _ = triangle_corners(clean)
    np.testing.assert_allclose(corners, clean.vertices[clean.triangles][:, :, :2] / 11, atol=1e-6)
    assert clean.pictures is mesh.pictures
