# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 7 of the adaptation: the flat mesh of the generic head as springs, its features held where they were found.

Lee, Terzopoulos and Waters 1995, section 2.2, after the adaptive meshes of Terzopoulos and Vasilescu 1991. The springs
are brought to rest by alternating between their directions and one linear system that is factorised once (as in
Bouaziz et al. 2014), not by time steps.
"""

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import factorized

ROUNDS = 40


def relax(flat: np.ndarray, edges: np.ndarray, pins: csr_matrix, goal: np.ndarray, hold: np.ndarray, around: float):
    """Where the nodes come to rest: (n, 2) mm.

    flat : (n, 2) mm, the generic mesh unrolled: along the longitude, and up
    edges : (e, 2) springs, at rest in the generic mesh
    pins : (k, n) sparse, a feature each as a mean of nodes; goal (k, 2) mm, where they are held by ``hold`` (k,) against 1
        for a spring of medium length
    around : mm of a whole turn: springs over the seam join there
    """
    n = len(flat)
    i, j = edges.T
    span = flat[j] - flat[i]
    turns = np.column_stack([np.rint(span[:, 0] / around) * around, np.zeros(len(edges))])
    span = span - turns
    length = np.maximum(np.linalg.norm(span, axis=1), 1e-3)
    stiff = np.median(length) / length
    rows = np.arange(len(edges))
    along = csr_matrix((np.ones(len(edges)), (rows, j)), shape=(len(edges), n)) - csr_matrix(
        (np.ones(len(edges)), (rows, i)), shape=(len(edges), n)
    )
    weighted = (along.T @ diags(stiff)).tocsr()
    held = (pins.T @ diags(hold)).tocsr()
    solve = factorized((weighted @ along + held @ pins + 1e-7 * diags(np.ones(n))).tocsc())
    at = flat.copy()
    calm = span  # begun as membranes that keep their shape, so that no triangle turns over before it is near
    for k in range(ROUNDS):
        right = weighted @ (calm + turns) + held @ goal + 1e-7 * flat
        moved = np.column_stack([solve(right[:, 0]), solve(right[:, 1])])
        done = k > 3 and np.abs(moved - at).max() < 1e-3
        at = moved
        if done:
            break
        now = along @ at - turns
        size = np.maximum(np.linalg.norm(now, axis=1, keepdims=True), 1e-6)
        # half of a spring keeps its length and half its direction: lengths alone would let triangles fold
        calm = 0.5 * now / size * length[:, None] + 0.5 * span
    return at
