# SPDX-License-Identifier: GPL-3.0-or-later
"""Flatten a disc of triangles without folds, then let it find its own lengths."""

import numpy as np
from scipy.sparse import coo_matrix, diags, identity
from scipy.sparse.linalg import splu, spsolve

from .steps import stepped


def mean_value(vertices: np.ndarray, triangles: np.ndarray, fixed: np.ndarray, where: np.ndarray) -> np.ndarray:
    """(n, 2) by mean value weights (Floater 2003); ``fixed`` vertices at ``where`` (k, 2), a convex outline."""
    rows, cols, values = [], [], []
    for k in range(3):
        i, j, m = triangles[:, k], triangles[:, (k + 1) % 3], triangles[:, (k + 2) % 3]
        a, b = vertices[j] - vertices[i], vertices[m] - vertices[i]
        la, lb = np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)
        cosine = np.clip((a * b).sum(axis=1) / np.maximum(la * lb, 1e-9), -0.999, 0.9999)
        tangent = np.sqrt((1 - cosine) / (1 + cosine))
        rows += [i, i]
        cols += [j, m]
        values += [tangent / np.maximum(la, 0.2), tangent / np.maximum(lb, 0.2)]
    n = len(vertices)
    weight = coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(cols))), shape=(n, n)).tocsr()
    total = np.asarray(weight.sum(axis=1)).ravel()
    system = identity(n, format="csr") - diags(1 / np.maximum(total, 1e-12)) @ weight
    known = np.zeros(n, dtype=bool)
    known[fixed] = True
    free = np.setdiff1d(np.unique(triangles), fixed)
    out = np.zeros((n, 2))
    out[fixed] = where
    out[free] = spsolve(system[free][:, free].tocsc(), -system[free][:, known] @ out[known])
    return out


def _energy(flat, triangles, inverse, area):
    """Symmetric Dirichlet energy (Smith and Schaefer 2015, 3.1), its gradient (n, 2), and the least determinant."""
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    jacobian = np.stack([b - a, c - a], axis=2) @ inverse
    det = np.linalg.det(jacobian)
    if det.min() <= 0:
        return np.inf, None, det.min()
    size = (jacobian**2).sum(axis=(1, 2))
    cofactor = np.empty_like(jacobian)
    cofactor[:, 0, 0], cofactor[:, 0, 1] = jacobian[:, 1, 1], -jacobian[:, 1, 0]
    cofactor[:, 1, 0], cofactor[:, 1, 1] = -jacobian[:, 0, 1], jacobian[:, 0, 0]
    slope = 2 * jacobian * (1 + 1 / det**2)[:, None, None] - 2 * (size / det**3)[:, None, None] * cofactor
    corner = (slope * area[:, None, None]) @ np.swapaxes(inverse, 1, 2)
    gradient = np.zeros_like(flat)
    for axis in range(2):
        for k, value in ((1, corner[:, axis, 0]), (2, corner[:, axis, 1])):
            gradient[:, axis] += np.bincount(triangles[:, k], value, minlength=len(flat))
            gradient[:, axis] -= np.bincount(triangles[:, 0], value, minlength=len(flat))
    gradient = gradient.astype(np.float32).astype(float)  # slopes of slivers are steep: in steps of their own size
    return float((area * size * (1 + 1 / det**2)).sum()), gradient, det.min()


def relax(vertices, triangles, flat, gain, weight, on_axis, rounds: int = 300) -> np.ndarray:
    """(n, 2): ``flat`` moved toward true lengths times ``gain`` (t,) without ever folding a triangle.

    ``weight`` (t,) says how much a triangle counts for its area. Vertices ``on_axis`` stay on x = 0; all others are
    free. Descent preconditioned by a Laplacian of the mesh; in `steps`, for rounding errors grow from round to round.
    """
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    e1, e2 = b - a, c - a
    x1 = np.linalg.norm(e1, axis=1)
    x2 = (e1 * e2).sum(axis=1) / x1
    y2 = np.linalg.norm(np.cross(e1, e2), axis=1) / x1
    y2 = np.maximum(y2, 0.08 * np.maximum(x1, np.abs(x2)))  # slivers do not count more than others
    rest = np.zeros((len(triangles), 2, 2))
    rest[:, 0, 0], rest[:, 0, 1], rest[:, 1, 1] = gain * x1, gain * x2, gain * y2
    area = 0.5 * x1 * y2 * weight
    inverse = np.linalg.inv(rest)
    fa, fb, fc = (flat[triangles[:, k]] for k in range(3))
    flat_area = 0.5 * np.abs((fb - fa)[:, 0] * (fc - fa)[:, 1] - (fb - fa)[:, 1] * (fc - fa)[:, 0]).sum()
    flat = stepped(flat * np.sqrt((area * gain**2).sum() / flat_area))
    n = len(vertices)
    pairs = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    link = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n)).tocsr()
    link = link + link.T
    base = (diags(np.asarray(link.sum(axis=1)).ravel() + 1e-3) - link).tocsc()
    solve_y = splu(base)
    inner = np.setdiff1d(np.arange(n), on_axis)
    solve_x = splu(base[inner][:, inner])
    energy, gradient, _ = _energy(flat, triangles, inverse, area)
    step = 1.0
    last, history = None, []
    for _ in range(rounds):
        gradient[on_axis, 0] = 0
        # limited-memory quasi-Newton (Nocedal 1980) with the Laplacian as first guess
        q = gradient.copy()
        kept = []
        for s, y, rho in reversed(history):
            alpha = rho * (s * q).sum()
            kept.append(alpha)
            q = q - alpha * y
        direction = np.zeros_like(flat)
        direction[inner, 0] = solve_x.solve(q[inner, 0])
        direction[:, 1] = solve_y.solve(q[:, 1])
        for (s, y, rho), alpha in zip(history, reversed(kept), strict=True):
            direction += s * (alpha - rho * (y * direction).sum())
        direction = -direction
        slope = float((gradient * direction).sum())
        if slope >= 0:
            history.clear()
            continue
        step = min(1.0, 4 * step)
        while step > 1e-9:
            trial = stepped(flat + step * direction)
            value, new_gradient, _ = _energy(trial, triangles, inverse, area)
            if value <= energy + 1e-4 * step * slope:
                break
            step *= 0.5
        else:
            break
        new_gradient[on_axis, 0] = 0
        s, y = trial - flat, new_gradient - gradient
        if (s * y).sum() > 1e-12:
            history = [*history[-7:], (s, y, 1 / (s * y).sum())]
        last = energy - value
        flat, energy, gradient = trial, value, new_gradient
        if last < 1e-6 * energy:
            break
    return flat
