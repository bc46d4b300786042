# SPDX-License-Identifier: GPL-3.0-or-later
"""What skin does where no data pull on it."""

import numpy as np
from scipy.sparse import identity

from headshop.sim.adapt.smooth_system import Smoothness, solve_displacement

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
