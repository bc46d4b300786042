# SPDX-License-Identifier: GPL-3.0-or-later
"""The regulariser of the last stage: how a displacement over a mesh is kept smooth, and the linear system it makes."""

import numpy as np
from scipy.sparse import bsr_matrix, coo_matrix, csr_matrix, diags, identity
from scipy.sparse.linalg import splu

from ..mesh import edges


def laplacian(vertices, faces) -> csr_matrix:
    """(n, n) matrix of ``u_i - mean of the neighbours' u``, neighbours weighted by one over their distance.

    vertices (n, 3) mm, faces (m, 3 or 4). Linear displacements over an even mesh give zero.
    """
    pair = edges(faces)
    n = len(vertices)
    length = np.linalg.norm(vertices[pair[:, 0]] - vertices[pair[:, 1]], axis=1)
    weight = 1 / np.maximum(length, 0.05 * np.median(length))
    link = coo_matrix((weight, (pair[:, 0], pair[:, 1])), shape=(n, n)).tocsr()
    link = link + link.T
    total = np.asarray(link.sum(axis=1)).ravel()
    return (identity(n) - diags(1 / np.where(total > 0, total, 1)) @ link).tocsr()


def factorised(matrix):
    """Solver of a symmetric positive definite sparse system."""
    return splu(
        matrix.tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    ).solve


def solve_displacement(smooth, sampling, blocks, pulls, start):
    """The displacement (n, 3) that minimises ``u^T smooth u + sum_s (S u - g)_s^T W_s (S u - g)_s``.

    smooth (n, n) the same for x, y, z; sampling S (s, n); blocks W (s, 3, 3); pulls W g (s, 3), mm; start (n, 3) a
    first guess. Solved by conjugate gradients, preconditioned with the factorised system whose blocks are all
    isotropic: a few steps, and each axis alone in the factor.
    """
    n = sampling.shape[1]
    count = len(blocks)
    if count:
        middle = bsr_matrix((blocks, np.arange(count), np.arange(count + 1)), shape=(3 * count, 3 * count))
        across = sampling.T.tocsr()
        right = (sampling.T @ pulls).ravel()
        # Between the pull along normals (full) and along the surface (weak): their geometric mean preconditions both.
        trace = np.einsum("kii->k", blocks) / 3
        rough = smooth + sampling.T @ diags(trace) @ sampling
    else:
        right, rough = np.zeros(3 * n), smooth
    precondition = factorised(rough + 1e-9 * identity(n))

    def apply(x):
        x = x.reshape(n, 3)
        out = smooth @ x
        if count:
            out += across @ (middle @ (sampling @ x).ravel()).reshape(-1, 3)
        return out.ravel()

    x = start.ravel().copy()
    r = right - apply(x)
    z = precondition(r.reshape(n, 3)).ravel()
    p, rz = z.copy(), float(r @ z)
    goal = 1e-7 * max(float(right @ precondition(right.reshape(n, 3)).ravel()), 1e-12)
    for _ in range(60):
        if rz <= goal:
            break
        q = apply(p)
        step = rz / float(p @ q)
        x += step * p
        r -= step * q
        z = precondition(r.reshape(n, 3)).ravel()
        rz, before = float(r @ z), rz
        p = z + (rz / before) * p
    return x.reshape(n, 3)
