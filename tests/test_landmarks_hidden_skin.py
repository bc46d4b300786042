# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin that a scan does not show goes on from what it shows as heads do: as full, without its ridges."""

import numpy as np
import pytest

from headshop.sim.adapt.closest import Surface
from headshop.sim.landmarks.hidden_skin import UNSEEN, likeliest_heights, unseen_scalp, with_hidden_skin
from headshop.sim.landmarks.shape_space import shape_space
from headshop.sim.mesh import vertex_normals


@pytest.fixture(scope="module")
def space(reference):
    return shape_space(reference)


def below_brows(space, points):
    """Those as a scan that ends above the brows, and mm from there down to each of the points (n,)."""
    down = space.landmarks(space.points)["sci_l"][2] + 6 - space.points[:, 2]
    return Surface(points, space.triangles[(down > 0)[space.triangles].all(axis=1)]), down


def test_likeliest_heights_go_on_as_they_begin_and_fade_out():
    there = np.array([[x, y, 0.0] for x in range(-20, 1, 2) for y in range(-20, 21, 4)], dtype=float)
    places = np.array([[3.0, 0, 0], [20.0, 0, 0], [400.0, 0, 0]])
    near, beyond, far = likeliest_heights(there, np.full(len(there), 2.0), places, (3.0, 30.0))
    assert near == pytest.approx(2.0, abs=0.2) and 0.3 < beyond < near and far == pytest.approx(0.0, abs=1e-6)


def filled_in(space, laid, off, heights):
    """Mm by which a forehead that is not seen comes to lie off a head off which the rest stands by ``off`` (n,)."""
    fit, normals = laid(space, space.points), vertex_normals(space.points, space.triangles)
    scan, down = below_brows(space, space.points + off[:, None] * normals)
    hidden = unseen_scalp(space, fit, scan)
    front = hidden & (down > -60) & (space.points[:, 1] < -20)
    assert front.sum() > 20
    return np.abs(with_hidden_skin(space, fit, hidden, scan, heights).closest(space.points[front], 9.0).distance)


ONE_KIND = [(60.0, (4.0, 25.0)), (60.0, (4.0, 45.0))]


@pytest.mark.parametrize("one_kind", ONE_KIND)
def test_a_forehead_that_is_not_seen_has_no_ridges_of_the_brow(space, laid, one_kind):
    """Ridges of 2 mm between and above the eyes end there: as heights of one kind they go on as waves."""
    _, down = below_brows(space, space.points)
    ridges = 2.0 * np.cos(2 * np.pi * space.points[:, 0] / 30) * (np.abs(down - 5) < 12) * (space.points[:, 1] < 0)
    waves = filled_in(space, laid, ridges, UNSEEN).max()
    assert waves < 0.5 and waves < 0.6 * filled_in(space, laid, ridges, one_kind).max()


def test_a_forehead_that_is_not_seen_is_about_as_full_as_the_face(space, laid):
    full = np.full(len(space.points), 2.0)
    above = filled_in(space, laid, full, UNSEEN)
    assert above.mean() > 2 * filled_in(space, laid, full, ONE_KIND[0]).mean()
    assert 0.5 < above.min() < above.max() < 2.0
