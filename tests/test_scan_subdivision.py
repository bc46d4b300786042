# SPDX-License-Identifier: GPL-3.0-or-later
"""Catmull-Clark: planes stay planes, known masks hold, a subdivided cube's limit is reached."""

import numpy as np

from headshop.sim.mesh_subdivision import limit, subdivision

CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
SIDES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]], dtype=np.int32)


def _grid(n=6):
    i = np.arange(n * n).reshape(n, n)
    quads = np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]], -1).reshape(-1, 4)
    x, y = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    return np.stack([x, y, 0 * x], -1).reshape(-1, 3).astype(float), quads


def test_rows_sum_to_one_and_counts_are_right():
    operator, quads, parent = subdivision(SIDES, 8, 2)
    np.testing.assert_allclose(operator.sum(axis=1), 1)
    assert len(quads) == 6 * 16 and operator.shape == (8 + 12 + 6 + 48 + 24, 8)
    np.testing.assert_array_equal(np.bincount(parent), np.full(6, 16))
    points = operator @ CUBE
    centre = points[quads].mean(axis=1)
    a, b, c = (points[quads[:, k]] for k in (0, 1, 3))
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), centre) > 0).all()  # still turned outward


def test_the_cube_has_the_published_first_step():
    points = subdivision(SIDES, 8, 1)[0] @ CUBE
    np.testing.assert_allclose(np.abs(points[:8]), 5 / 9)
    np.testing.assert_allclose(np.sort(np.abs(points[8:20]), axis=1), np.tile([0, 0.75, 0.75], (12, 1)))


def test_the_limit_is_where_many_steps_lead():
    few, quads, _ = subdivision(SIDES, 8, 1)
    many, _, _ = subdivision(SIDES, 8, 6)
    reached = (limit(quads, few.shape[0]) @ few)[:8]
    np.testing.assert_allclose(reached @ CUBE, many[:8] @ CUBE, atol=1e-3)


def test_a_grid_with_a_boundary_stays_in_its_plane_and_keeps_its_corners():
    points, quads = _grid()
    operator, fine, _ = subdivision(quads, len(points), 3)
    smooth = limit(fine, operator.shape[0]) @ operator @ points
    np.testing.assert_allclose(smooth[:, 2], 0)
    np.testing.assert_allclose([smooth.min(), smooth.max()], [0, 5], atol=0.15)
    inside = (points[:, :2] > 1).all(axis=1) & (points[:, :2] < 4).all(axis=1)
    np.testing.assert_allclose(smooth[: len(points)][inside], points[inside], atol=1e-9)  # linear precision


def test_triangles_and_loose_vertices_are_legal():
    faces = np.array([[0, 1, 2, -1], [0, 2, 3, -1]], dtype=np.int32)
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [9, 9, 9]], dtype=float)
    operator, quads, parent = subdivision(faces, 5, 1)
    np.testing.assert_array_equal(parent, [0, 0, 0, 1, 1, 1])
    np.testing.assert_allclose((operator @ points)[4], 9)
    np.testing.assert_allclose(operator.sum(axis=1), 1)
