# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles of a piece are wound alike; what cannot be, stays."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from headshop.sim.health.topology import closed, volume
from headshop.sim.mesh import Mesh
from headshop.sim.scan.winding import wound_alike


def ball(count):
    """A sphere's triangles, outside out."""
    points = np.random.default_rng(count).normal(size=(count, 3))
    points *= 50 / np.linalg.norm(points, axis=1, keepdims=True)
    triangles = ConvexHull(points).simplices
    a, b, c = points[triangles].transpose(1, 0, 2)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    return points, turned(triangles, inward)


def turned(triangles, some):
    out = triangles.copy()
    out[some] = out[some, ::-1]
    return out


@pytest.mark.parametrize("share", [0.01, 0.2, 0.45])
def test_the_lesser_part_is_turned_back(share):
    points, triangles = ball(2000)
    wrong = np.random.default_rng(1).random(len(triangles)) < share
    mixed = turned(triangles, wrong)
    assert (wound_alike(mixed, len(points)) == wrong).all()


def test_pieces_are_judged_each_by_itself():
    points, triangles = ball(500)
    up = points[triangles].mean(axis=1)[:, 2] > -10  # more than half of them
    both = np.concatenate([turned(triangles, up), triangles + len(points)])
    alike = turned(both, wound_alike(both, 2 * len(points)))
    first, second = (Mesh.from_triangles(points, t) for t in (alike[: len(up)], alike[len(up) :] - len(points)))
    assert closed(first) and closed(second)
    assert volume(first) < 0 < volume(second)


def test_what_is_wound_alike_stays_and_so_does_what_cannot_be():
    points, triangles = ball(300)
    assert not wound_alike(triangles, len(points)).any()
    k = np.arange(8)
    low, high = np.stack([2 * k, 2 * k + 1], axis=1), np.stack([2 * k + 2, 2 * k + 3], axis=1)
    high[-1] = [1, 0]  # the last is joined to the first the other way up
    strip = np.concatenate(
        [np.stack([low[:, 0], low[:, 1], high[:, 0]], 1), np.stack([high[:, 0], low[:, 1], high[:, 1]], 1)]
    )
    assert not wound_alike(strip, 16).any()
