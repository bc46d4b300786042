# SPDX-License-Identifier: GPL-3.0-or-later
"""Voids of range and colour maps filled by relaxation: a membrane or a thin plate is stretched over them.

Lee, Terzopoulos and Waters 1995, section 2.1, after Terzopoulos 1988: the surface of least bending energy

    (1 - t) (u_xx^2 + 2 u_xy^2 + u_yy^2) + t (u_x^2 + u_y^2)

that goes through what is known; t = 1 is the membrane, t = 0 the plate, which keeps slopes and so flattens less. Solved
coarse to fine, as there: directly on the coarsest grid, then by conjugate gradients from the coarser answer.
"""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix, diags, identity, kron, vstack
from scipy.sparse.linalg import splu

from .range_map import RangeMap

#: Unknowns solved for directly; more are begun on a grid of half the size.
DIRECT = 14_000
#: Conjugate gradient steps at most, and the residual at which they stop, relative.
STEPS, CLOSE = 40, 1e-4


def filled(range_map: RangeMap, tension: float = 0.0, colour_tension: float = 1.0) -> RangeMap:
    """The map without voids in range and colour: ``valid`` everywhere. As published: plate for range, membrane for colour.

    tension, colour_tension : 1 for a membrane, 0 for a thin plate
    """
    wide = float(np.nanmedian(range_map.radius)) * range_map.step
    around, spacing = range_map.closed, (wide, range_map.rise)
    radius = relaxed(range_map.radius, range_map.valid, around, tension, spacing)
    lowest = 0.5 * np.nanmin(range_map.radius)
    colour = range_map.colour
    if colour is not None:
        known = np.isfinite(colour).all(axis=2)
        if known.any():
            colour = relaxed(colour, known, around, colour_tension, spacing).clip(0, 1).astype(np.float32)
    return replace(range_map, radius=np.maximum(radius, lowest), valid=np.ones(range_map.shape, bool), colour=colour)


def relaxed(values, known, closed: bool, tension: float = 1.0, spacing=(1.0, 1.0)) -> np.ndarray:
    """``values`` (h, w) or (h, w, k) with those not ``known`` (h, w) relaxed; the known ones are not touched.

    closed : the last column borders on the first; spacing : width and height of a texel, in one unit
    """
    values = np.asarray(values, dtype=float)
    flat = values.reshape(*known.shape, -1)
    out = np.where(known[..., None], flat, 0.0)
    if known.all():
        return values.copy()
    if not known.any():
        raise ValueError("nothing is known, so there is nothing to stretch a surface over")
    out = _solve(out, known, closed, tension, spacing)
    return out.reshape(values.shape)


def _solve(values, known, closed, tension, spacing):
    h, w, _ = values.shape
    unknown = np.flatnonzero(~known.ravel())
    energy = _energy(h, w, closed, tension, spacing)
    flat = values.reshape(h * w, -1)
    rows = energy[unknown]
    matrix = rows[:, unknown].tocsc()
    scale = matrix.diagonal()
    matrix = matrix + diags(1e-10 * scale)
    right = -(rows @ np.where(known.reshape(-1, 1), flat, 0.0))
    out = flat.copy()
    if len(unknown) <= DIRECT or min(h, w) < 16:
        out[unknown] = splu(matrix, permc_spec="MMD_AT_PLUS_A").solve(right)
    else:
        start = _coarser(values, known, closed, tension, spacing).reshape(h * w, -1)[unknown]
        out[unknown] = _descend(matrix.tocsr(), right, start, scale)
    return out.reshape(values.shape)


def _energy(h, w, closed, tension, spacing):
    """(h w, h w) symmetric matrix of the quadratic energy on the grid; free at open sides."""
    across, up = _difference(w, closed) / spacing[0], _difference(h, False) / spacing[1]
    one_w, one_h = identity(w), identity(h)
    terms = []
    if tension > 0:
        terms += [np.sqrt(tension) * kron(one_h, across), np.sqrt(tension) * kron(up, one_w)]
    if tension < 1:
        bend = np.sqrt(1 - tension) * np.sqrt(spacing[0] * spacing[1])  # in units of a texel, to mix with the tension
        second_x = (
            _difference(w, True) @ _difference(w, True) if closed else _difference(w - 1, False) @ _difference(w, False)
        )
        second_y = _difference(h - 1, False) @ _difference(h, False)
        terms.append(bend / spacing[0] ** 2 * kron(one_h, second_x))
        terms.append(bend / spacing[1] ** 2 * kron(second_y, one_w))
        terms.append(np.sqrt(2) * bend * kron(up, across))
    rows = vstack([t.tocsr() for t in terms]).tocsr()
    return (rows.T @ rows).tocsr()


def _difference(n, closed) -> csr_matrix:
    """(n - 1 or n, n) differences of neighbours."""
    out = diags([-np.ones(n), np.ones(n - 1)], [0, 1], shape=(n, n)).tolil()
    if closed:
        out[n - 1, 0] = 1.0
        return out.tocsr()
    return out.tocsr()[: n - 1]


def _coarser(values, known, closed, tension, spacing):
    """The answer on a grid of half the rows and columns, brought back to this one."""
    h, w, k = values.shape
    rows, columns = (h + 1) // 2, (w + 1) // 2
    i, j = np.arange(h) // 2, np.arange(w) // 2
    weight = np.zeros((rows, columns))
    total = np.zeros((rows, columns, k))
    at = np.ix_(i, j)
    np.add.at(weight, at, known.astype(float))
    np.add.at(total, at, np.where(known[..., None], values, 0.0))
    some = weight > 0
    mean = total / np.maximum(weight, 1)[..., None]
    coarse = _solve(mean, some, closed and w % 2 == 0, tension, (2 * spacing[0], 2 * spacing[1]))
    y = np.clip((np.arange(h) - 0.5) / 2, 0, rows - 1)
    x = (np.arange(w) - 0.5) / 2
    x = np.mod(x, columns) if closed and w % 2 == 0 else np.clip(x, 0, columns - 1)
    i, j = np.minimum(y.astype(int), max(rows - 2, 0)), x.astype(int)
    beside = (j + 1) % columns if closed and w % 2 == 0 else np.minimum(j + 1, columns - 1)
    v, u = (y - i)[:, None, None], (x - j)[None, :, None]
    below = np.minimum(i + 1, rows - 1)
    upper = coarse[i][:, j] * (1 - u) + coarse[i][:, beside] * u
    lower = coarse[below][:, j] * (1 - u) + coarse[below][:, beside] * u
    return upper * (1 - v) + lower * v


def _descend(matrix, right, start, scale):
    """Conjugate gradients from ``start`` (n, k), all right sides at once, preconditioned by the diagonal."""
    x = start.copy()
    r = right - matrix @ x
    z = r / scale[:, None]
    p, rz = z.copy(), np.einsum("ij,ij->j", r, z)
    goal = CLOSE**2 * np.maximum(np.einsum("ij,ij->j", right, right / scale[:, None]), 1e-30)
    for _ in range(STEPS):
        if (rz <= goal).all():
            break
        q = matrix @ p
        step = np.where(rz > 0, rz / np.maximum(np.einsum("ij,ij->j", p, q), 1e-300), 0)
        x += step * p
        r -= step * q
        z = r / scale[:, None]
        rz, before = np.einsum("ij,ij->j", r, z), rz
        p = z + np.where(before > 0, rz / np.maximum(before, 1e-300), 0) * p
    return x
