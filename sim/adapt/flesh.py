# SPDX-License-Identifier: GPL-3.0-or-later
"""The flesh in the inner corner of the eye keeps clear of the lids around it and of the ball behind it."""

import numpy as np
from scipy.sparse import coo_matrix, diags, vstack
from scipy.spatial import cKDTree

from ..anatomy.head import Eye
from ..mesh import Mesh, edges
from ..mesh_piercing import piercings
from ..mesh_subdivision import smoother
from ..progress import Progress, Work, finish, portion
from .closest import Surface
from .lid_contact import height_over

#: mm that the flesh keeps from the lids and from the ball.
FROM_LIDS, FROM_BALL = 0.08, 0.06
#: mm of skin around it that is looked at; rounds, of which all but the last `FIRM` also even out the moves.
AROUND, ROUNDS, FIRM = 2.5, 18, 10
#: Sizes of the flesh that are tried until it cuts nothing.
SIZES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4)


def cleared(flesh: Mesh, skin: Mesh, eye: Eye, room: float = 1.0) -> np.ndarray:
    """`clearing`, at once."""
    return finish(clearing(flesh, skin, eye, room))


def clearing(flesh: Mesh, skin: Mesh, eye: Eye, room: float = 1.0) -> Work:
    """Work returning (k, 3) mm: the vertices of ``flesh`` moved off the ``skin``, cage and drawn surface, and off the ball
    of ``eye``.

    room : share of the usual distances that is kept. Where there is too little space, the flesh shrinks toward its middle.
    """
    operator, quads = smoother(skin.faces, len(skin.vertices))
    tree = cKDTree(flesh.vertices)
    walls, near = [], []
    for mesh in (skin, Mesh(operator @ skin.vertices, quads)):
        inside = tree.query(mesh.vertices, distance_upper_bound=AROUND)[0] < AROUND
        near.append((mesh.vertices, mesh.triangles[inside[mesh.triangles].any(axis=1)]))
        walls.append(Surface(*near[-1]))
    middle = flesh.vertices.mean(axis=0)
    for k, share in enumerate(SIZES):
        smaller = flesh.moved(middle + share * (flesh.vertices - middle))
        out = yield from portion(_pushed(smaller, walls, eye, room), k / len(SIZES), (k + 1) / len(SIZES))
        if not any(len(piercings(*skin_near, out, flesh.triangles)) for skin_near in near):
            break
    return out


def _pushed(flesh: Mesh, walls, eye: Eye, room: float) -> Work:
    start = flesh.vertices
    mean, samples = _mean(flesh), _samples(flesh)
    out = start.copy()
    for turn in range(ROUNDS):
        touched = False
        yield Progress(turn / ROUNDS, "Corners of the eyes")
        for wall in walls:
            points = samples @ out
            found = wall.closest(points)
            over = np.einsum("ij,ij->i", points - found.points, found.normals)
            push = np.where(found.found, np.maximum(room * FROM_LIDS - over, 0), 0)
            touched |= bool(push.max(initial=0) > 0.25 * room * FROM_LIDS)
            share = samples.T @ (push > 0)
            out += samples.T @ (push[:, None] * found.normals) / np.maximum(share, 0.25)[:, None]
        away = out - eye.centre
        short = np.maximum(room * FROM_BALL - height_over(out, eye), 0)
        out += (short / np.linalg.norm(away, axis=1))[:, None] * away
        if turn >= ROUNDS - FIRM:
            if not touched:
                break
        else:
            move = out - start
            out = start + mean @ (0.5 * (move + mean @ move))
    return out


def _samples(mesh: Mesh):
    """(s, k): the vertices, the middles of the edges and of the faces."""
    n = len(mesh.vertices)
    groups = (np.arange(n)[:, None], edges(mesh.faces), mesh.faces)
    parts = []
    for rows in groups:
        k, size = rows.shape
        entry = (np.full(k * size, 1 / size), (np.repeat(np.arange(k), size), rows.ravel()))
        parts.append(coo_matrix(entry, shape=(k, n)))
    return vstack(parts).tocsr()


def _mean(mesh: Mesh):
    """(k, k): the mean over a vertex's neighbours."""
    a, b = edges(mesh.faces).T
    n = len(mesh.vertices)
    link = coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(n, n)).tocsr()
    return diags(1 / np.maximum(np.asarray(link.sum(axis=1)).ravel(), 1)) @ link
