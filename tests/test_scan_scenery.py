# SPDX-License-Identifier: GPL-3.0-or-later
"""Walls, floors and tables of a scan, and what is left without them."""

import numpy as np
import pytest

from headshop.sim.mesh import Mesh
from headshop.sim.scan.scenery import LARGE, in_walls, pieces, without


def sheet(corner, along, up, step=20.0, rough=0.0):
    """A rough, flat grid from its ``corner``: a mesh."""
    along, up = np.array(along, float), np.array(up, float)
    m, n = (max(int(np.linalg.norm(side) / step), 2) for side in (along, up))
    a, b = np.meshgrid(np.linspace(0, 1, m), np.linspace(0, 1, n), indexing="ij")
    out = np.cross(along, up) / np.linalg.norm(np.cross(along, up))
    points = corner + a[..., None] * along + b[..., None] * up
    points = points + np.random.default_rng(m + n).normal(0, rough, (m, n, 1)) * out
    index = np.arange(m * n).reshape(m, n)
    one, two, three, four = index[:-1, :-1], index[1:, :-1], index[:-1, 1:], index[1:, 1:]
    sides = [np.stack([one, two, three], axis=-1), np.stack([two, four, three], axis=-1)]
    return Mesh.from_triangles(points.reshape(-1, 3), np.concatenate(sides).reshape(-1, 3))


def together(*meshes):
    start = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    triangles = [mesh.triangles + s for mesh, s in zip(meshes, start, strict=False)]
    return Mesh.from_triangles(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(triangles))


@pytest.fixture(scope="module")
def head(reference):
    skin = reference.skin.triangles
    return Mesh.from_triangles(reference.skin.vertices, skin[(reference.groups["inner"] < 0.5)[skin].all(axis=1)])


@pytest.mark.parametrize("rough", [0.0, 5.0])
def test_a_wall_behind_a_head_is_seen_and_the_head_is_not(head, rough):
    wall = sheet((-600.0, 300.0, -700.0), (1200, 0, 0), (0, 0, 1200), rough=rough)
    scan = together(head, wall)
    seen = in_walls(scan, 1.0)
    assert not seen[: len(head.triangles)].any()
    assert seen[len(head.triangles) :].mean() > 0.97
    assert np.array_equal(in_walls(scan.moved(scan.vertices / 1000), 1000.0), seen)


def test_a_head_and_a_seat_are_no_walls(head):
    side = 0.9 * np.sqrt(LARGE)
    scan = together(head, sheet((0.0, 300.0, 0.0), (side, 0, 0), (0, 0, side)))
    assert not in_walls(scan, 1.0).any()


def test_both_sides_of_a_board_are_a_wall(head):
    """Taken together they would lie off any plane by half the board's thickness."""
    top = sheet((-700.0, -450.0, -320.0), (1400, 0, 0), (0, 900, 0))
    below = sheet((-700.0, -450.0, -360.0), (0, 900, 0), (1400, 0, 0))
    seen = in_walls(together(head, top, below), 1.0)
    assert not seen[: len(head.triangles)].any()
    assert seen[len(head.triangles) :].mean() > 0.9


def test_a_wall_that_leans_and_one_that_crosses_the_head_are_taken_without_it(head):
    """The plane of a board behind the head, to its left and right, goes through the face."""
    middle = head.vertices.mean(axis=0)
    boards = [sheet(middle + (x, -400.0, 30.0), (600, 0, 40), (0, 800, 0)) for x in (-900.0, 300.0)]
    seen = in_walls(together(head, *boards), 1.0)
    assert not seen[: len(head.triangles)].any()
    assert seen[len(head.triangles) :].mean() > 0.95


def test_walls_that_are_drawn_are_walls(head):
    square = np.array([(-900.0, 400.0, -900.0), (900, 400, -900), (900, 400, 900), (-900, 400, 900)])
    scan = together(head, Mesh.from_triangles(square, [(0, 1, 2), (0, 2, 3)]))
    assert np.flatnonzero(in_walls(scan, 1.0)).tolist() == [len(head.triangles), len(head.triangles) + 1]
    scan = together(scan, sheet((-600.0, 500.0, -700.0), (1200, 0, 0), (0, 0, 1200)))  # and a scanned one
    assert in_walls(scan, 1.0)[len(head.triangles) :][:2].all()


def test_a_single_triangle_has_no_walls():
    assert not in_walls(Mesh.from_triangles([(0, 0, 0), (9, 0, 0), (0, 9, 0)], [(0, 1, 2)]), 1.0).any()


def test_pieces_come_the_largest_first_without_specks(head):
    wall = sheet((-600.0, 300.0, -700.0), (1200, 0, 0), (0, 0, 1200))
    speck = Mesh.from_triangles([(0, -300, 0), (9, -300, 0), (0, -300, 9)], [(0, 1, 2)])
    small = sheet((0.0, -300.0, 0.0), (100, 0, 0), (0, 0, 100), step=5.0)
    scan = together(small, speck, wall, head)
    left = without(scan, in_walls(scan, 1.0))
    assert len(left.faces) == len(small.faces) + len(head.faces) + 1
    found = pieces(left, 2)
    assert [len(piece.faces) for piece in found][-1] == len(small.faces)
    assert sum(len(piece.faces) for piece in found) == len(small.faces) + len(head.faces)
    assert [len(piece.faces) for piece in found] == sorted((len(piece.faces) for piece in found), reverse=True)
    assert pieces(left, 10**6) == []
    assert pieces(without(scan, np.ones(len(scan.triangles), bool)), 1) == []
