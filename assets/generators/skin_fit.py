# SPDX-License-Identifier: GPL-3.0-or-later
"""Bring a placed skin onto another head: thin-plate spline through landmarks, then smooth steps to the surface."""

import numpy as np
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import splu

from ...sim.adapt.closest import Surface
from ...sim.adapt.thin_plate_spline import ThinPlateSpline
from ...sim.mesh import Mesh, edges, vertex_normals
from ...sim.mesh_subdivision import limit
from .skin_bust import NECK_ROW
from .skin_heads import MeasuredSubject
from .skin_layout import Layout

#: The end of the nose is fitted no finer than this, mm.
COARSE = 14.0


def outer_skin(layout: Layout, eyes_open: bool = True) -> np.ndarray:
    """(n,) bool: vertices that lie on what a scan shows reliably (no ears, no nostrils, no inside, no lid margins)."""
    outer = np.zeros(layout.count, dtype=bool)
    outer[layout.grid[layout.grid >= 0]] = True
    outer[layout.crown] = True
    outer[layout.rings["mouth"][1:4]] = True
    for side in ("_l", "_r"):
        outer[layout.rings["eye" + side][1:4]] = eyes_open
        outer[layout.rings["ear" + side][0]] = False
        outer[layout.rings["nostril" + side][0]] = False
    below = layout.grid[NECK_ROW + 2 :]
    outer[below[below >= 0]] = False  # shoulders are carried differently by everyone
    return outer


def nose_end(layout: Layout) -> np.ndarray:
    """(n,) bool: tip and wings of the nose, too small for scans to be averaged point by point."""
    end = np.zeros(layout.count, dtype=bool)
    part = np.concatenate([layout.grid[11:16, u] for u in range(-4, 5)])
    end[part[part >= 0]] = True
    end[layout.grid[15, 0]] = False
    return end


def bending(vertices: np.ndarray, triangles: np.ndarray):
    """Bending energy (n, n) and vertex areas (n,) mm²: cotangent Laplacian squared (Botsch and Sorkine 2008, 3)."""
    n = len(vertices)
    corner = [vertices[triangles[:, k]] for k in range(3)]
    area = np.linalg.norm(np.cross(corner[1] - corner[0], corner[2] - corner[0]), axis=1) / 2
    rows, cols, values = [], [], []
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        dot = ((corner[i] - corner[k]) * (corner[j] - corner[k])).sum(axis=1)
        weight = np.clip(0.5 * dot / np.maximum(2 * area, 1e-3), 0.02, 5)
        rows += [triangles[:, i], triangles[:, j]]
        cols += [triangles[:, j], triangles[:, i]]
        values += [weight, weight]
    link = coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(cols))), shape=(n, n)).tocsr()
    laplacian = diags(np.asarray(link.sum(axis=1)).ravel()) - link
    mass = np.maximum(np.bincount(triangles.ravel(), np.repeat(area / 3, 3), minlength=n), 0.5)
    return (laplacian @ diags(1 / mass) @ laplacian).tocsc(), mass


def fair(layout: Layout, vertices: np.ndarray, weight: np.ndarray, length: float) -> np.ndarray:
    """Smooth away what is finer than ``length`` mm where ``weight`` (n,) 0..1 is above 0."""
    energy, mass = bending(vertices, Mesh(vertices, layout.faces).triangles)
    hold = np.where(weight > 0, mass / np.maximum(weight, 1e-3), 1e9)
    return splu((diags(hold) + length**4 * energy).tocsc()).solve(hold[:, None] * vertices)


def fit_skin(
    layout: Layout,
    start: np.ndarray,
    start_landmarks: dict[str, np.ndarray],
    subject: MeasuredSubject,
    lengths: tuple[float, ...] = (45, 30, 22, 16, 12, 9, 7),
    reach: float = 12.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Control vertices (n, 3) mm whose limit surface lies on a head, and how far each is known there, (n,) 0..1.

    ``start`` is stiff over each of ``lengths`` mm in turn; the limit operator stands in the normal equations, so that
    what subdivision rounds off is made up for.
    """
    skin = Mesh(start, layout.faces).triangles
    surface = Surface(subject.vertices, subject.triangles)
    names = sorted(set(subject.landmarks) & set(start_landmarks))
    spline = ThinPlateSpline.fit(
        np.array([start_landmarks[n] for n in names]), np.array([subject.landmarks[n] for n in names])
    )
    x = spline.transform(start)
    energy, mass = bending(start, skin)
    smooth = limit(layout.faces, layout.count)
    use = outer_skin(layout, subject.eyes_open) & subject.seen(start)
    end = nose_end(layout)
    for length in lengths:
        on = smooth @ x
        contact = surface.closest(on)
        facing = (contact.normals * vertex_normals(on, skin)).sum(axis=1) > 0.5
        ok = (
            (use & ~end if length < COARSE else use)
            & contact.found
            & (contact.distance < reach)
            & facing
            & ~contact.border
        )
        step = np.where(ok[:, None], contact.points - on, 0.0)
        hold = diags(mass * ok)
        system = smooth.T @ hold @ smooth + diags(1e-4 * mass) + length**4 * energy
        x = x + splu(system.tocsc()).solve(smooth.T @ (hold @ step))
    return x, _spread(layout, (ok | (end & use)).astype(float))


def _spread(layout: Layout, known: np.ndarray, rounds: int = 3) -> np.ndarray:
    """Weights (n,) softened over the neighbours, so that a mean of heads has no steps where one of them ends."""
    pairs = edges(layout.faces)
    ij = (np.r_[pairs[:, 0], pairs[:, 1]], np.r_[pairs[:, 1], pairs[:, 0]])
    link = coo_matrix((np.ones(2 * len(pairs)), ij), shape=(layout.count,) * 2).tocsr()
    degree = np.asarray(link.sum(axis=1)).ravel()
    for _ in range(rounds):
        known = 0.5 * known + 0.5 * (link @ known) / degree
    return known
