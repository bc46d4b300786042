# SPDX-License-Identifier: GPL-3.0-or-later
"""Points of the surface drawn of a cage: which of them look for data, and which can be seen."""

import numpy as np

from headshop.sim.adapt.drawn_points import drawn_points
from headshop.sim.mesh_subdivision import smoother

SIDE = 5


def grid():
    """(m, 4) quads of a flat square cage."""
    k = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    return np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=-1).reshape(-1, 4)


def test_points_in_between_do_what_all_vertices_around_them_do():
    faces, n = grid(), SIDE * SIDE
    some = np.ones(n, dtype=bool)
    some[12] = False  # the middle
    every = np.ones(n, dtype=bool)
    surface = drawn_points(faces, some, every)
    assert surface.seen.all() and len(surface.outer) == len(surface.triangles) == 8 * len(faces)
    # The vertex itself, and the middles of its four sides and of its four faces.
    assert (~surface.look).sum() == 9 and not surface.look[12]
    rows, _ = smoother(faces, n)
    assert abs(surface.rows - rows).max() == 0


def test_what_is_kept_is_not_taken_for_another_choice():
    faces, n = grid(), SIDE * SIDE
    every, some = np.ones(n, dtype=bool), np.arange(n) > 2
    for free, seen in ((every, every), (some, every), (every, some), (some.astype(int), some)):
        surface = drawn_points(faces, free, seen)
        np.testing.assert_array_equal(surface.look[:n], np.asarray(free, dtype=bool))
        np.testing.assert_array_equal(surface.seen[:n], seen)
    turned = drawn_points(faces[:, ::-1], every, every)
    assert (turned.triangles != drawn_points(faces, every, every).triangles).any()
