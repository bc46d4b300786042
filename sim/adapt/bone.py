# SPDX-License-Identifier: GPL-3.0-or-later
"""Bone under fitted skin: moved by tissue-depth vectors, then kept inside (Kähler et al. 2002, section 5.2, item 2)."""

import numpy as np
from scipy.sparse import csr_matrix, identity, vstack

from ..anatomy.inside import inside
from ..anatomy.tissue_depth import skull_targets
from ..mesh import Mesh
from .closest import Surface
from .smooth_system import factorised, laplacian
from .thin_plate_spline import ThinPlateSpline

#: mm of tissue that always remain over bone: where the reference has little, and where it has more.
THIN, THICK = 1.2, 2.0
INSIDE_MOUTH = 0.4  # mm, toward the closed cups behind lips, lids and nostrils
NEAR = 12.0  # mm: bone deeper than this needs no test


def depth_under(points, skin: Surface, reach: float = np.inf):
    """How deep ``points`` (k, 3) lie under the skin, mm, negative outside; and the `Contacts` found.

    Points out of reach are as deep as ``reach``. Where the normal at the closest point is plain about the side it
    decides, else the winding number; the closed cups behind lips and lids count as outside.
    """
    found = skin.closest(points, reach)
    depth = np.where(found.found, found.distance, reach)
    near = np.flatnonzero(found.found)
    rise = np.einsum("ij,ij->i", points[near] - found.points[near], found.normals[near])
    out = rise > 0
    unsure = np.flatnonzero(np.abs(rise) < 0.7 * found.distance[near])
    out[unsure] = ~inside(points[near[unsure]], skin.vertices, skin.triangles)
    depth[near[out]] *= -1
    return depth, found


def follow_skin(vertices, skull_marks, landmarks, vectors, smoothing: float = 2.0):
    """The warp from the bone's current landmarks to those the tissue vectors ask for (5.2, item 2).

    vertices (n, 3) mm; skull_marks, landmarks, vectors : names -> (3,) mm, the bone's landmarks as they are, the
    fitted skin's, and the vectors from bone to skin. Returns (n, 3) mm.
    """
    wanted = skull_targets(landmarks, vectors)
    names = [n for n in wanted if n in skull_marks]
    if len(names) < 4:
        return np.array(vertices)
    source = np.array([skull_marks[n] for n in names])
    target = np.array([wanted[n] for n in names])
    return ThinPlateSpline.fit(source, target, smoothing).transform(vertices)


def least_depth(reference_depth, inner) -> np.ndarray:
    """(k,) mm of tissue that must remain over bone vertices.

    reference_depth (k,) mm over the same vertices of the reference head; inner (k,) bool: the nearest skin there is a
    cup behind lips, lids or nostrils. Never more than the reference itself has.
    """
    wanted = np.clip(0.5 * reference_depth, THIN, THICK)
    wanted = np.where(inner, INSIDE_MOUTH, wanted)
    return np.where(reference_depth > 0, np.minimum(wanted, np.maximum(0.95 * reference_depth, 0.3)), 0.3)


def keep_inside(bone: Mesh, skin: Surface, least, rounds: int = 12) -> np.ndarray:
    """Bone vertices (n, 3) moved smoothly until each, and each face, lies ``least`` (n,) mm or deeper under the skin."""
    start = bone.vertices
    bend = laplacian(start, bone.faces)
    n = len(start)
    smooth = (bend.T @ bend + 0.002 * identity(n)).tocsr()
    look = vstack([identity(n), face_middles(bone.faces, n)]).tocsr()
    least = np.concatenate([least, np.minimum(least[bone.faces[:, :3]].min(axis=1), THIN)])
    moved = start.copy()
    pulled = np.zeros(look.shape[0], dtype=bool)
    goal = np.zeros((look.shape[0], 3))
    watch = np.arange(look.shape[0])
    rest = look @ start
    for turn in range(rounds):
        points = look[watch] @ moved
        depth, found = depth_under(points, skin, NEAR)
        lack = least[watch] - depth
        wrong = found.found & (lack > 1e-3)
        if not wrong.any():
            return moved
        way = (found.points - points)[wrong] * np.where(depth[wrong] < 0, 1.0, -1.0)[:, None]
        length = np.linalg.norm(way, axis=1, keepdims=True)
        # On the skin itself the way is unsure, and the skin's own normal tells.
        way = np.where(length > 0.05, way / np.maximum(length, 1e-9), -found.normals[wrong])
        bad, push = watch[wrong], (lack[wrong, None] + 0.05) * way
        goal[bad] = points[wrong] - rest[bad] + push
        pulled[bad] = True
        watch = watch[found.found & (lack > -4.0)]  # what is that much deeper than it must be, stays so
        if turn < rounds - 4:
            weight = look[pulled].T * 3.0
            moved = start + factorised((smooth + weight @ look[pulled]).tocsc())(weight @ goal[pulled])
        else:  # what smoothness will not give, is given without
            share = look[bad].T @ np.ones(len(bad))
            moved += (look[bad].T @ push) / np.maximum(share, 1.0)[:, None]
    return moved


def face_middles(faces, n) -> csr_matrix:
    """(m, n) sparse rows that give the middle of each face, of three or four corners."""
    real = faces >= 0
    rows = np.repeat(np.arange(len(faces)), real.sum(axis=1))
    return csr_matrix((1 / real.sum(axis=1)[rows], (rows, faces[real])), shape=(len(faces), n))
