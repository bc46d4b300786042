# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin vertices attach to muscles, or to skull and mandible (Kähler et al. 2002, section 3; 2001).

Each vertex finds the muscles under it once, along its inward normal. The topmost takes most of it, the next ones and
bone the rest, and each hold fades toward the muscle's border, so that neighbours do not part there: the paper's vertices
have one muscle each. Boneless places hang on an anchor in the flesh. Feet go with the mandible by the skin's own share of
the jaw's motion: 1 on the chin, less where skin slides over the ramus, none on the skull.
"""

import numpy as np
from scipy import sparse

from ...anatomy.head import Head
from ...anatomy.muscle_room import both_ways
from ...mesh import edges, vertex_normals
from ..geometry import cotangent_stiffness, smoothed
from ..muscle_field import theta_2
from ..structures import Layers
from .parameters import Parameters
from .structures import Attachments, Fibres

#: mm beside a muscle over which its hold on skin fades; mm under the skin (less where only lining is over it); mm
#: over the skin that a fibre may seem to lie.
_BESIDE, _DEPTH, _DEPTH_LINING, _ABOVE = 5.0, 14.0, 9.0, 1.0
#: mm deeper by which a muscle has e times less of the skin.
_OVER = 1.0
#: Times that weights are averaged with those of neighbours.
_ROUNDS = 2
#: By how much the jaw's shares of skin and fibre may differ.
_APART = 0.25
_MOUTH = ("mouth_bag", "lip_upper", "lip_lower")
_LIDS = tuple(f"lid_{k}_{s}" for k in ("upper", "lower") for s in "lr")


def build_attachments(head: Head, layers: Layers, fibres: Fibres, parameters: Parameters) -> Attachments:
    """The feet of all skin vertices of ``head``."""
    skin, n = head.skin, len(layers.area)
    triangles = both_ways(skin.faces)  # so that both halves of a symmetric face are alike
    normal = vertex_normals(skin.vertices, triangles)
    zero = np.zeros(n)
    group = {k: np.asarray(head.groups.get(k, zero), float) for k in ("inner", *_MOUTH, *_LIDS)}
    lid = np.clip(np.max([group[k] for k in _LIDS], axis=0), 0, 1)
    mouth = np.max(
        [group[k] for k in _MOUTH], axis=0
    )  # the lining of lips hangs on them, that of nose and lids does not
    spare = np.clip(1 - lid, 0, 1) ** 2 * (group["inner"] - mouth < 0.5) * layers.free[:n]
    deepest = np.where(group["inner"] > 0.5, _DEPTH_LINING, _DEPTH)
    holds, depths, weights = [], [], []
    for k in range(int(fibres.muscle.max(initial=-1)) + 1):
        rows = np.flatnonzero(fibres.muscle == k)
        hold, depth, weight = _hold(skin.vertices, normal, layers.jaw, fibres, rows, deepest)
        holds.append(hold * spare)
        depths.append(depth)
        weights.append(weight)
    if not holds:
        none = sparse.csr_matrix((n, 0))
        return Attachments(layers.nodes[2 * n :], none, layers.jaw, layers.soften)
    part = stacked(np.array(holds), np.array(depths), parameters.opacity)
    total = part.sum(axis=0)
    # bone and muscle are two springs side by side: where bone holds weakly, the foot goes with the muscle
    held = total + (1 - total) * layers.soften
    moves = sum(sparse.diags(part[k] / np.maximum(held, 1e-9)) @ weights[k] for k in range(len(weights)))
    moves = evened(moves, edges(skin.faces), spare)
    depth = (part * np.array(depths)).sum(axis=0) / np.maximum(total, 1e-9)
    # straight inward: where bone lies to both sides alike, under the chin, the nearest point of it is a matter of chance
    offset = -np.linalg.norm(layers.nodes[2 * n :] - skin.vertices, axis=1)[:, None] * normal
    offset = offset + total[:, None] * (-np.maximum(depth, 1.0)[:, None] * normal - offset)
    offset = smoothed(offset, 0.5 * cotangent_stiffness(skin.vertices, triangles), layers.area, 2.0)
    return Attachments(skin.vertices + offset, moves.tocsr(), layers.jaw, held)


def stacked(holds, depths, opacity: float) -> np.ndarray:
    """(m, n) share of each vertex that each muscle takes; together 1 - product of (1 - opacity * hold), bone the rest.

    Among themselves they share by their hold, and for each `_OVER` mm that one lies deeper e times less: the topmost
    takes most, and two of one depth (at the midline, left and right) the same. holds (m, n) 0..1; depths (m, n) mm.
    """
    together = 1 - np.prod(1 - opacity * holds, axis=0)
    top = np.where(holds > 0, depths, np.inf).min(axis=0, initial=np.inf)
    part = holds * np.exp(-np.maximum(depths - np.where(np.isfinite(top), top, 0.0), 0) / _OVER)
    return together * part / np.maximum(part.sum(axis=0), 1e-12)


def evened(moves, pairs, spare, rounds: int = _ROUNDS):
    """Sparse weights (n, k) averaged with those of the neighbours (pairs (e, 2)), so that the end of a narrow muscle does
    not crease the skin; ``spare`` (n,) 0..1: the share that muscles may take."""
    n = len(spare)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    mean = sparse.csr_matrix((np.ones(len(both)), (both[:, 0], both[:, 1])), (n, n))
    mean = sparse.diags(0.5 / np.maximum(np.asarray(mean.sum(axis=1)).ravel(), 1)) @ mean + 0.5 * sparse.identity(n)
    for _ in range(rounds):
        moves = sparse.diags(spare) @ (mean @ moves)
    return moves


def _hold(vertices, normal, jaw, fibres: Fibres, rows, deepest):
    """Hold (n,) 0..1 of one muscle, its depth (n,) mm and the weights (n, k) sparse of its points, rows sum to 1."""
    n = len(vertices)
    points, fibre = fibres.points[rows], fibres.fibre[rows]
    box = (vertices > points.min(axis=0) - _DEPTH - _BESIDE) & (vertices < points.max(axis=0) + _DEPTH + _BESIDE)
    near = np.flatnonzero(box.all(axis=1))
    inside = np.flatnonzero(fibre[1:] == fibre[:-1])
    a, step = points[inside], points[inside + 1] - points[inside]
    length = np.maximum(np.linalg.norm(step, axis=1), 1e-9)
    rel = vertices[near][:, None] - a[None]
    t = np.clip(np.einsum("vsj,sj->vs", rel, step) / length**2, 0, 1)
    away = rel - t[..., None] * step[None]
    deep = np.einsum("vsj,vj->vs", away, normal[near])
    side = np.sqrt(np.maximum(np.einsum("vsj,vsj->vs", away, away) - deep**2, 0))
    across = _spacing(points, fibre)
    under = np.clip((deep + _ABOVE) / _ABOVE, 0, 1) * np.clip(2 - 2 * deep / deepest[near, None], 0, 1)
    # a lip hangs on its own half of the mouth's muscle, though the other one's fibres may lie under it
    share = fibres.share[rows]
    share = share[inside] + t * (share[inside + 1] - share[inside])
    apart = np.abs(jaw[near, None] - share)
    under = under * np.clip(2 - apart / _APART, 0, 1)
    hold = theta_2(np.maximum(side - 0.5 * across, 0) / _BESIDE) * under
    weight = hold * np.exp(-((side / max(0.6 * across, 1.5)) ** 2))
    total = weight.sum(axis=1)
    found = np.flatnonzero(total > 1e-9)
    out_hold, out_depth = np.zeros(n), np.full(n, 1e3)
    out_hold[near] = hold.max(axis=1, initial=0.0)
    share = weight[found] / total[found, None]
    out_depth[near[found]] = (share * np.maximum(deep[found], 0)).sum(axis=1)
    v, s = np.nonzero(share > 1e-4)
    value, where = share[v, s], t[found][v, s]
    row = near[found][v]
    data = np.concatenate([value * (1 - where), value * where])
    column = rows[np.concatenate([inside[s], inside[s] + 1])]
    matrix = sparse.csr_matrix((data, (np.tile(row, 2), column)), (n, len(fibres.points)))
    scale = np.asarray(matrix.sum(axis=1)).ravel()
    return out_hold, out_depth, sparse.diags(1 / np.maximum(scale, 1e-12)) @ matrix


def _spacing(points, fibre) -> float:
    """Median mm from one fibre to the next."""
    length = np.bincount(fibre - fibre.min())
    if len(length) < 2 or (length != length[0]).any():
        return 0.0
    grid = points.reshape(len(length), length[0], 3)
    return float(np.median(np.linalg.norm(np.diff(grid, axis=0), axis=2)))
