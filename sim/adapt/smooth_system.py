# SPDX-License-Identifier: GPL-3.0-or-later
"""The regulariser of the last stage: how a displacement over a mesh is kept smooth, and the linear system it makes."""

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags, identity
from scipy.sparse.linalg import splu

from ..mesh import edges

FINEST = 4.0  # most by which fine parts of the mesh are stiffened
STRETCH = 0.002  # weight of first differences, which keeps the mesh from sliding where bending is free
#: Least weight of first differences against bending. Skin beyond the data is moved as its edge is; it does not go on along
#: the slope there, which the noise of few data tells.
CALM = 0.02
#: Energy of what is left, against that of the pulls, at which the system counts as solved; as solved enough to go on from.
SOLVED, ROUGHLY = 1e-5, 3e-5
FOLDED = 6.0  # factor on the stiffness around a fold
#: Share of how data hold two places, each by itself, below which their tie is left out of what preconditions: its factor has
#: about half of the numbers, it takes no more steps, and they leave no more undone. From .08 on that is four to ten times more.
TIED = 0.02


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


def fineness(vertices, faces) -> np.ndarray:
    """(n,) factor on the stiffness: the same bend costs as much in a fine mesh as in a coarse one.

    A Laplacian without units sees a bend over short edges as small; small features would be the first to fold.
    """
    a, b = edges(faces).T
    length = np.linalg.norm(vertices[a] - vertices[b], axis=1)
    n = len(vertices)
    count = np.bincount(a, minlength=n) + np.bincount(b, minlength=n)
    mean = (np.bincount(a, length, n) + np.bincount(b, length, n)) / np.maximum(count, 1)
    usual = np.median(mean[count > 0])
    return np.clip((usual / np.maximum(mean, 1e-6)) ** 2, 1.0, FINEST)


def stretch(bend):
    """Energy (n, n) of first differences, symmetric, from the neighbours in the Laplacian ``bend`` (n, n)."""
    link = -(bend - diags(bend.diagonal()))
    link = link.maximum(link.T)
    total = np.asarray(link.sum(axis=1)).ravel()
    return diags(total) - link


class Smoothness:
    """The energy ``u^T matrix u`` of a displacement over a mesh, with parts that are stiffer than others.

    vertices (n, 3) mm, faces (m, 3 or 4); stiffness (n,) : factor on the energy of bending

    factor : solver of the last system made with it, which preconditions those that are much like it; None if there is
        none
    """

    def __init__(self, vertices, faces, stiffness):
        self._bend = laplacian(vertices, faces)
        self._stiffness = np.asarray(stiffness, dtype=float) * fineness(vertices, faces)
        self._stretch = stretch(self._bend).tocsr()
        self._weigh()

    def _weigh(self):
        self._bending = (self._bend.T @ diags(self._stiffness) @ self._bend).tocsr()
        self.factor = None

    def matrix(self, soft: float) -> csr_matrix:
        """(n, n) with the energy of bending times ``soft``."""
        return soft * self._bending + max(STRETCH, CALM * soft) * self._stretch

    def stiffen(self, at) -> None:
        """Make the surroundings of the vertices ``at`` (n,) bool stiffer: they folded."""
        near = np.asarray(at, dtype=float)
        for _ in range(2):
            near = np.maximum(near, (np.abs(self._bend) @ near > 0) * 0.9)
        self._stiffness = self._stiffness * np.where(near > 0, FOLDED, 1.0)
        self._weigh()


def factorised(matrix):
    """Solver of a symmetric positive definite sparse system."""
    return splu(
        matrix.tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    ).solve


def loosened(matrix, told) -> csr_matrix:
    """A symmetric positive definite sparse ``matrix`` (n, n) without ties that are weak beside ``told`` (n,), that part of its
    diagonal which data make up.

    What is left out is added to both ends (Ajiz and Jennings 1984), so it stays positive definite. Where there are no data
    nothing is left out: what is added would hold the skin back there.
    """
    matrix, held = matrix.tocsr(), np.sqrt(told)
    row, strength = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr)), np.abs(matrix.data)
    weak = (strength < TIED * held[row] * held[matrix.indices]) & (row != matrix.indices)
    lost = np.bincount(row, np.where(weak, strength, 0.0), matrix.shape[0])
    kept = coo_matrix((matrix.data[~weak], (row[~weak], matrix.indices[~weak])), shape=matrix.shape)
    return kept.tocsr() + diags(lost)


def solve_displacement(smoothness: Smoothness, soft, sampling, weight, normals, along, pulls, start, left=SOLVED):
    """The displacement (n, 3) that minimises ``u^T smooth u + sum_s (S u - g)_s^T W_s (S u - g)_s``.

    smooth (n, n) : that of ``smoothness`` when it is so ``soft``, the same for x, y, z; sampling S (s, n); W_s = weight
    (normal normal^T + along 1) of weight (s,), normals (s, 3), zero for a point that is pulled alike every way, and along
    (s,); pulls W g (s, 3), mm; start (n, 3) a first guess; left : `SOLVED` or `ROUGHLY`. Solved by conjugate
    gradients, preconditioned with a factorised system whose W are all isotropic: a few steps, and each axis alone in the
    factor. It is that of an earlier call where ``smoothness`` has one.
    """
    smooth = smoothness.matrix(soft)
    n = sampling.shape[1]
    across = sampling.T.tocsr()
    right = across @ pulls
    if smoothness.factor is None:
        # Between the pull along normals (full) and along the surface (weak): their mean preconditions both.
        trace = weight * ((normals**2).sum(axis=1) / 3 + along)
        data = across @ diags(trace) @ sampling
        smoothness.factor = factorised(loosened(smooth + data + 1e-9 * identity(n), data.diagonal()))
    precondition = smoothness.factor
    normals, flat = normals * np.sqrt(weight)[:, None], (weight * along)[:, None]

    def apply(x):
        at = sampling @ x
        pull = flat * at
        pull += normals * np.einsum("ij,ij->i", normals, at)[:, None]
        return smooth @ x + across @ pull

    x = np.array(start, dtype=float)
    r = right - apply(x) if x.any() else right.copy()
    z = precondition(r)
    p, rz = z, float(np.vdot(r, z))
    goal = left * max(float(np.vdot(right, precondition(right))) if x.any() else rz, 1e-12)
    for _ in range(60):
        if rz <= goal:
            break
        q = apply(p)
        step = rz / float(np.vdot(p, q))
        x += step * p
        r -= step * q
        z = precondition(r)
        rz, before = float(np.vdot(r, z)), rz
        p = z + (rz / before) * p
    return x
