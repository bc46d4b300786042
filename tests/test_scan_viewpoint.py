# SPDX-License-Identifier: GPL-3.0-or-later
"""Depth maps agree with geometry that can be worked out by hand."""

import numpy as np

from headshop.sim.scan.viewpoint import Viewpoint, depth_map


def _view(yaw=0.0, pitch=0.0):
    return Viewpoint.around([0, 0, 0], yaw, pitch, 600, 2.0, 200, 160)


def _sheet(y, half):
    points = np.array([[-half, y, -half], [half, y, -half], [half, y, half], [-half, y, half]], dtype=float)
    return points, np.array([[0, 1, 2], [0, 2, 3]])


def test_the_camera_looks_where_it_should():
    view = _view()
    np.testing.assert_allclose(view.centre, [0, -600, 0])
    np.testing.assert_allclose(view.project(np.zeros((1, 3))), [[50, 40, 600]])
    x, y, _ = view.project(np.array([[20.0, 0, 40]]))[0]  # the subject's left is right in the image, up is up
    assert x > 50 and y < 40
    assert _view(yaw=np.pi / 2).centre[0] > 599 and _view(pitch=0.5).centre[2] > 200


def test_points_undo_project():
    view = _view(0.4, -0.3)
    points = np.random.default_rng(2).uniform(-60, 60, (50, 3))
    np.testing.assert_allclose(view.points(*view.project(points).T), points, atol=1e-9)


def test_a_tilted_plane_has_the_depth_of_the_rays():
    view = _view(0.5, 0.2)
    points, triangles = _sheet(0.0, 40)
    seen = depth_map(view, points, triangles)
    where = seen.triangle >= 0
    assert where.sum() > 500
    hit = seen.sample(points, triangles, where)
    np.testing.assert_allclose(hit[:, 1], 0, atol=1e-9)
    row, column = np.nonzero(where)
    np.testing.assert_allclose(
        view.project(hit), np.column_stack([column + 0.5, row + 0.5, seen.depth[where]]), atol=1e-8
    )


def test_the_nearer_sheet_hides_the_other():
    near, triangles = _sheet(-50.0, 20)
    far, _ = _sheet(50.0, 60)
    seen = depth_map(_view(), np.concatenate([far, near]), np.concatenate([triangles, triangles + 4]))
    assert seen.depth[40, 50] == 550 and seen.triangle[40, 50] >= 2
    assert np.isclose(seen.depth[20, 50], 650) and seen.triangle[20, 50] in (0, 1)
    assert seen.depth[0, 0] == np.inf and seen.triangle[0, 0] == -1


def test_batches_change_nothing(monkeypatch):
    rng = np.random.default_rng(3)
    points, triangles = rng.uniform(-50, 50, (300, 3)), rng.integers(0, 300, (200, 3))
    whole = depth_map(_view(), points, triangles)
    monkeypatch.setattr("headshop.sim.scan.viewpoint.BATCH", 500)
    parts = depth_map(_view(), points, triangles)
    np.testing.assert_array_equal(whole.depth, parts.depth)
    np.testing.assert_array_equal(whole.triangle, parts.triangle)
