# SPDX-License-Identifier: GPL-3.0-or-later
"""What skin does where no data pull on it, and how its displacement is solved for."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import identity, vstack

from headshop.sim.adapt import smooth_system
from headshop.sim.adapt.smooth_system import Smoothness, laplacian, loosened, solve_displacement

COLUMNS, ROWS, STEP = 60, 8, 4.0
TOLD = 20  # columns with data
RISE = 0.1  # mm from one of them to the next


def test_skin_beyond_the_data_goes_where_its_edge_goes_and_not_along_the_slope_there():
    x, y = (a.ravel() for a in np.meshgrid(np.arange(COLUMNS), np.arange(ROWS), indexing="ij"))
    k = np.arange(COLUMNS * ROWS).reshape(COLUMNS, ROWS)
    quads = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=-1).reshape(-1, 4)
    vertices = STEP * np.stack([x, y, np.zeros(len(x))], axis=1)
    n, up = len(vertices), np.array([0.0, 0.0, 1.0])
    told = np.flatnonzero(x < TOLD)
    smooth = Smoothness(vertices, quads, np.ones(n))
    pulls = RISE * x[told, None] * up
    sampling, weight = identity(n, format="csr")[told], np.ones(len(told))
    for soft in (4.0, 0.6, 0.12):
        smooth.factor = None
        faces, along = np.tile(up, (len(told), 1)), np.full(len(told), 0.02)
        moved = solve_displacement(smooth, soft, sampling, weight, faces, along, pulls, np.zeros((n, 3)))
        height = moved[:, 2].reshape(COLUMNS, ROWS).mean(axis=1)
        edge, end = height[TOLD - 1], height[-1]
        assert abs(height[10] - 10 * RISE) < 0.1  # on the data
        assert 0 < end - edge < 0.1 * RISE * (COLUMNS - TOLD)  # the slope would end at all of it
        assert np.abs(np.diff(height[TOLD - 5 :], 2)).max() < 0.4 * RISE  # without a kink


def told_mesh():
    """A wavy grid, rows that mix vertices beside each other as points in between do, and which of them have data."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(COLUMNS), np.arange(ROWS), indexing="ij"))
    k = np.arange(COLUMNS * ROWS).reshape(COLUMNS, ROWS)
    quads = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=-1).reshape(-1, 4)
    vertices = STEP * np.stack([x, y, np.sin(x / 4)], axis=1)
    smooth = Smoothness(vertices, quads, np.ones(len(vertices)))
    beside = abs(laplacian(vertices, quads))
    beside.data[:] = 1
    own = identity(len(vertices), format="csr")
    rows = vstack([own, 0.7 * own + 0.075 * beside])[np.flatnonzero(np.tile(x < TOLD, 2))].tocsr()
    return smooth, rows, x < TOLD


def test_a_system_without_weak_ties_is_stronger_where_there_are_data_and_the_same_elsewhere():
    smooth, rows, there = told_mesh()
    data = rows.T @ rows
    whole = (smooth.matrix(0.005) + data).tocsr()
    loose = loosened(whole, data.diagonal())
    assert loose.nnz < 0.9 * whole.nnz
    change = (loose - whole).toarray()
    assert np.linalg.eigvalsh(change).min() > -1e-12
    assert np.abs(change[~there][:, ~there]).max() < 1e-12
    strength = eigh(loose.toarray(), whole.toarray(), eigvals_only=True)
    assert strength.min() > 1 - 1e-9 and strength.max() < 2


def test_what_preconditions_has_weak_ties_left_out_where_there_are_data_only(monkeypatch):
    smooth, rows, there = told_mesh()
    count, n = rows.shape
    factorised, seen = smooth_system.factorised, []
    monkeypatch.setattr(smooth_system, "factorised", lambda matrix: seen.append(matrix) or factorised(matrix))
    up, pulls = np.tile([0, 0, 1.0], (count, 1)), np.ones((count, 3))
    solve_displacement(smooth, 0.005, rows, np.ones(count), up, np.full(count, 0.02), pulls, np.zeros((n, 3)))
    made, alone, data = seen[0].toarray(), smooth.matrix(0.005).toarray(), (rows.T @ rows).toarray()
    untold = data.diagonal() == 0
    np.testing.assert_allclose(made[untold], alone[untold], atol=1e-8)
    assert (made[there] != 0).sum() < 0.8 * ((alone + data)[there] != 0).sum()


@pytest.mark.parametrize("start", [0.0, 0.5])
def test_it_is_solved_as_well_with_weak_ties_left_out(start, monkeypatch):
    smooth, rows, there = told_mesh()
    count, n = rows.shape
    rng = np.random.default_rng(2)
    normals = rng.normal(0, 0.3, (count, 3)) + [0, 0, 1.0]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    goal = rng.normal(0, 1, (count, 3))
    along = np.full(count, 0.02)
    pulls = normals * np.einsum("ij,ij->i", normals, goal)[:, None] + along[:, None] * goal
    first = np.full((n, 3), start)

    def solved(left):
        smooth.factor = None
        return solve_displacement(smooth, 0.005, rows, np.ones(count), normals, along, pulls, first, left)

    exact, off = solved(1e-18), []
    for tied in (smooth_system.TIED, 0.0):
        monkeypatch.setattr(smooth_system, "TIED", tied)
        off.append(np.abs(solved(1e-5) - exact).max())
    assert 0 < off[0] < 2 * off[1] and off[0] < 0.02 * np.abs(exact).max()
