# SPDX-License-Identifier: GPL-3.0-or-later
"""What counts in the likeness of two poses: the error of samples left out, its slope, and what is told from it."""

import numpy as np
import pytest

from headshop.sim.response.kernel import LINEAR, SQUARE, matern, matern_slope, noise
from headshop.sim.response.relevance import _left_out, relevance
from headshop.sim.response.rig import _Group


def _samples(count=40, inputs=4):
    rng = np.random.default_rng(5)
    bending, forces = rng.uniform(-1, 1, (2, count, inputs))
    motion = np.stack([np.abs(bending[:, 0]) + forces[:, 1], bending[:, 0] ** 2], axis=1)
    return bending, forces, motion


def _kernel(relevances, bending, forces):
    """The regression's, written out: distances and products one by one."""
    apart = ((bending[:, None] - bending) ** 2) @ relevances
    rest = matern(bending**2 @ relevances)
    product = (forces[:, None] * forces) @ relevances
    return matern(apart) - rest[:, None] * rest + LINEAR * product + SQUARE * product**2


def test_the_error_of_samples_left_out_is_that_of_leaving_them_out():
    bending, forces, motion = _samples()
    relevances, weight = np.array([1.0, 0.4, 0.2, 0.7]), np.linspace(0.2, 1, len(motion))
    kernel = _kernel(relevances, bending, forces)
    noisy = kernel + np.diag(noise(kernel))
    off = np.zeros(len(motion))
    for k in range(len(motion)):
        others = np.arange(len(motion)) != k
        told = kernel[k, others] @ np.linalg.solve(noisy[np.ix_(others, others)], motion[others])
        off[k] = ((told - motion[k]) ** 2).sum()
    value, _ = _left_out(relevances, bending, forces, motion, weight)
    assert value == pytest.approx(weight @ off / weight.sum(), rel=1e-6)


def test_its_slope_is_that_of_small_steps():
    bending, forces, motion = _samples()
    relevances, weight = np.array([1.0, 0.4, 0.2, 0.7]), np.ones(len(motion))
    _, slope = _left_out(relevances, bending, forces, motion, weight)
    for k in range(4):
        step = np.zeros(4)
        step[k] = 1e-5
        more, less = (_left_out(relevances + s, bending, forces, motion, weight)[0] for s in (step, -step))
        # Noise follows the kernel's diagonal, of which the slope takes no notice.
        assert slope[k] == pytest.approx((more - less) / 2e-5, rel=0.02, abs=1e-4)


def test_the_kernels_slope():
    squared = np.array([0.1, 1.0, 7.0])
    steps = (matern(squared + 1e-6) - matern(squared - 1e-6)) / 2e-6
    np.testing.assert_allclose(matern_slope(squared), steps, rtol=1e-6)


def test_what_moves_nothing_comes_to_count_for_little():
    bending, forces, motion = _samples(400)
    scale = np.array([1.0, 1.0, 1.0, 0.0])
    found, off = relevance(bending, forces, np.tile(motion, 3), scale, 0)
    assert found[3] == 0  # stays out
    assert found[0] > 3 * found[2], found
    before = _left_out(scale[:3] ** 2, bending[:, :3], forces[:, :3], motion, np.ones(400))[0]
    after = _left_out(found[:3] ** 2, bending[:, :3], forces[:, :3], motion, np.ones(400))[0]
    assert after < 0.5 * before
    assert off == pytest.approx(np.sqrt(after * 3 / 2), rel=0.01)  # per vertex of three numbers


def test_a_group_of_regions_says_what_the_kernel_says():
    bending, forces, _ = _samples()
    weight = np.array([[1.0, 0.4, 0.2], [0.3, 0.0, 0.9]])
    felt = np.array([0, 2, 3])
    group = _Group(felt, *(x.astype(np.float32) for x in (weight, bending[:30, felt].T, forces[:30, felt].T)))
    said = group.kernels(forces[30:].astype(np.float32), bending[30:].astype(np.float32))
    for row, relevances in zip(said, weight, strict=True):
        whole = np.zeros(4)
        whole[felt] = relevances
        product = (forces @ np.diag(whole) @ forces.T)[30:, :30]
        expected = _kernel(whole, bending, forces)[30:, :30] - LINEAR * product  # what is linear has weights of its own
        np.testing.assert_allclose(row[:, :30], expected, atol=2e-5)
        np.testing.assert_array_equal(row[:, 30:], forces[30:].astype(np.float32))
