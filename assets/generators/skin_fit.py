# SPDX-License-Identifier: GPL-3.0-or-later
"""Bring a placed skin onto another head: thin-plate spline through landmarks, then smooth steps to the surface."""

import numpy as np
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import splu

from ...sim.adapt.closest import Surface
from ...sim.adapt.thin_plate_spline import ThinPlateSpline
from ...sim.mesh import Mesh, vertex_normals
from .skin_bust import NECK_ROW
from .skin_layout import Layout


def outer_skin(layout: Layout, eyes_open: bool = True) -> np.ndarray:
    """(n,) bool: vertices that lie on what a scan shows reliably (no ears, no inside, no lid margins)."""
    outer = np.zeros(layout.count, dtype=bool)
    outer[layout.grid[layout.grid >= 0]] = True
    outer[layout.crown] = True
    outer[layout.rings["mouth"][1:4]] = True
    for side in ("_l", "_r"):
        outer[layout.rings["eye" + side][1:4]] = eyes_open
        outer[layout.rings["ear" + side][0]] = False
    below = layout.grid[NECK_ROW + 2 :]
    outer[below[below >= 0]] = False  # shoulders are carried differently by everyone
    return outer


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
    vertices: np.ndarray,
    triangles: np.ndarray,
    landmarks: dict[str, np.ndarray],
    eyes_open: bool = True,
    lengths: tuple[float, ...] = (45, 30, 22, 16, 12),
    reach: float = 12.0,
) -> np.ndarray:
    """(n, 3) mm: ``start`` on the head (``vertices``, ``triangles``), stiff over each of ``lengths`` mm in turn."""
    skin = Mesh(start, layout.faces).triangles
    surface = Surface(vertices, triangles)
    names = sorted(set(landmarks) & set(start_landmarks))
    spline = ThinPlateSpline.fit(np.array([start_landmarks[n] for n in names]), np.array([landmarks[n] for n in names]))
    x = spline.transform(start)
    energy, mass = bending(start, skin)
    use = outer_skin(layout, eyes_open)
    for length in lengths:
        contact = surface.closest(x)
        facing = (contact.normals * vertex_normals(x, skin)).sum(axis=1) > 0.5
        ok = use & contact.found & (contact.distance < reach) & facing & ~contact.border
        step = np.where(ok[:, None], contact.points - x, 0.0)
        hold = diags(mass * (ok + 1e-4))
        x = x + splu((hold + length**4 * energy).tocsc()).solve(hold @ step)
    return x
