# SPDX-License-Identifier: GPL-3.0-or-later
"""What the solver steps by: the dissected matrix and the memory of the curvature, against their definitions."""

import numpy as np
import pytest
from scipy import sparse

from headshop.sim.tissue.curvature import Curvature
from headshop.sim.tissue.dissection import Dissection, parted


def _plate(side):
    """Stiffness (side², side²) of a bending plate on springs, and the places of its nodes."""
    chain = sparse.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(side, side))
    laplacian = sparse.kron(chain, sparse.eye(side)) + sparse.kron(sparse.eye(side), chain)
    row, column = np.divmod(np.arange(side**2), side)
    return (laplacian @ laplacian + 0.1 * sparse.eye(side**2)).tocsr(), np.stack([column, row, 0 * row], 1).astype(
        float
    )


@pytest.mark.parametrize("side", (6, 45))
def test_dissection_solves(side):
    matrix, places = _plate(side)
    wanted = np.random.default_rng(1).normal(size=(side**2, 3))
    found = Dissection(matrix, *parted(matrix, places)).solve(matrix @ wanted)
    assert found == pytest.approx(wanted, abs=2e-3)


def test_parted_blocks_are_not_coupled():
    matrix, places = _plate(45)
    blocks, between = parted(matrix, places)
    assert sorted(np.concatenate([*blocks, between])) == list(range(45**2))
    assert len(blocks) > 2 and len(between) < 0.2 * 45**2
    for k, block in enumerate(blocks):
        for other in blocks[k + 1 :]:
            assert matrix[block][:, other].nnz == 0


def test_compact_memory_is_bfgs():
    """Against the update (Nocedal and Wright 2006, 6.17) of the scaled inverse, pair by pair; older pairs are dropped."""
    rng = np.random.default_rng(2)
    root = rng.normal(size=(12, 12))
    stiff = root @ root.T + np.eye(12)
    inverse = np.diag(1 / np.diag(stiff))
    memory, pairs = Curvature(4), []
    for _ in range(7):
        step = rng.normal(size=12)
        change = stiff @ step
        memory.add(step, change, inverse @ change)
        pairs.append((step, change))
    memory.add(step, -change, -inverse @ change)  # curves downwards: teaches nothing
    pairs = pairs[-4:]
    full = inverse * np.median([s @ y / (y @ inverse @ y) for s, y in pairs])
    for s, y in pairs:
        keep = np.eye(12) - np.outer(s, y) / (s @ y)
        full = keep @ full @ keep.T + np.outer(s, s) / (s @ y)
    gradient = rng.normal(size=12)
    assert memory.applied(gradient, inverse @ gradient) == pytest.approx(full @ gradient, rel=1e-4, abs=1e-4)
    assert len(memory) == 4
    memory.clear()
    assert (memory.applied(gradient, gradient) == gradient).all()
