# SPDX-License-Identifier: GPL-3.0-or-later
"""Merged muscles pull on each other: springs along the middle axis of each muscle, with a common node where muscles merge
(Kähler et al. 2002, section 3).

A contracted muscle's springs rest at (1 - s c) of their length, so it draws the common node and stretches its passive
partners; those have springs too. What lies round a muscle (its bed, our own addition, or a slack chain would fold) holds
each station to its place, and that of a contracted muscle to where its own fibre would bring it. A muscle hardly pushes:
shortened passively its springs keep a tenth of their stiffness. Muscles that end in a sphincter share a node with it
where they end; ends that share fibres but lie apart are tied.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ...anatomy.head import Muscle
from .fibres import on_polygons
from .leapfrog import relax
from .parameters import Parameters
from .sphincter import drawn_together
from .structures import Axes

_SLACK = 0.1
_SAME = 1.0  # mm between fibre ends that are one point


def free_ends(muscles: list[Muscle]) -> tuple[np.ndarray, np.ndarray]:
    """(e,) muscle and (e,) which end (0 root, 1 tip) of every end that may merge: tips, and both ends of an arc."""
    owner, tip = [], []
    for k, muscle in enumerate(muscles):
        if muscle.ring:
            continue
        ends = (0, 1) if muscle.kind == "sphincter" else (1,)
        owner += [k] * len(ends)
        tip += ends
    return np.array(owner, int), np.array(tip, int)


def shared(muscles: list[Muscle], owner, tip) -> np.ndarray:
    """(p, 2) pairs of ends (rows of ``owner``) whose fibres have an end in common."""
    points = [muscles[k].fibres[:, -1 if t else 0] for k, t in zip(owner, tip, strict=True)]
    which = np.repeat(np.arange(len(owner)), [len(x) for x in points])
    if not len(which):
        return np.zeros((0, 2), int)
    pairs = which[cKDTree(np.concatenate(points)).query_pairs(_SAME, output_type="ndarray")]
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    return pairs[pairs[:, 0] != pairs[:, 1]]


def interlaced(muscles: list[Muscle], begin, owner, tip, within: float) -> np.ndarray:
    """(p, 2) stations: tips of muscles that end in a sphincter, and the station of it nearest to them.

    begin (m,): first station of each muscle; owner, tip (e,): as `free_ends` has them; within : mm
    """
    pairs = [np.zeros((0, 2), int)]
    ends = np.array([muscles[k].path[-1] for k in owner]).reshape(-1, 3)
    straight = np.array([muscles[k].kind != "sphincter" for k in owner], bool) & (tip > 0)
    for k, muscle in enumerate(muscles):
        if muscle.kind == "sphincter":
            far, near = cKDTree(muscle.path).query(ends)
            hit = np.flatnonzero(straight & (far <= within))
            last = np.array([begin[owner[e]] + len(muscles[owner[e]].path) - 1 for e in hit], int)
            pairs.append(np.stack([last, begin[k] + near[hit]], axis=1))
    return np.concatenate(pairs)


def numbered(pairs, free) -> np.ndarray:
    """(s,) node of each station, -1 where not ``free`` (s,); ``pairs`` (p, 2) of stations are one node."""
    s = len(free)
    joined = sparse.csr_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (s, s))
    _, label = connected_components(joined, directed=False)
    held = np.zeros(label.max(initial=-1) + 1, bool)
    held[label[~free]] = True
    order = np.cumsum(~held) - 1
    return np.where(held[label], -1, order[label])


def axis_positions(axes: Axes, posed, moved) -> np.ndarray:
    """(s, 3) mm: stations ``posed`` (s, 3) with their nodes displaced by ``moved`` (q, 3)."""
    return posed + np.concatenate([moved, np.zeros((1, 3))])[axes.node]


def aims(axes: Axes, posed, centre, line, normal, contraction, slide) -> np.ndarray:
    """(s, 3) mm: where each muscle's own fibres would bring its axis at ``contraction`` (m,) 0..1 of `shortening`, with the
    centres of sphincters moved by ``slide`` (m,) mm."""
    start = np.diff(axes.muscle, prepend=-1) != 0
    c = (axes.shortening * contraction)[axes.muscle]
    length = np.zeros(len(posed))
    length[1:] = np.linalg.norm(np.diff(posed, axis=0), axis=1)
    length[start] = 0
    along = np.cumsum(length)
    along -= np.repeat(along[start], np.diff(np.append(np.flatnonzero(start), len(posed))))
    straight, _ = on_polygons(posed, along, start, axes.muscle, (1 - c) * along)
    shift = slide[axes.muscle]
    keep = normal * axes.flat[axes.muscle, None]
    circular = drawn_together(posed, centre[axes.muscle], c, shift, line[axes.muscle], keep)
    return np.where(axes.round[axes.muscle, None], circular, straight)


def net_force(axes: Axes, posed, aim, contraction, parameters: Parameters, moved) -> tuple[float, np.ndarray]:
    """Energy and force (q, 3) on the nodes displaced by ``moved`` (q, 3)."""
    x = axis_positions(axes, posed, moved)
    alive = 1 + parameters.active * np.append(contraction, 0.0)
    short = 1 - np.append(axes.shortening * contraction, 0.0)
    d = x[axes.second] - x[axes.first]
    length = np.sqrt(np.einsum("ij,ij->i", d, d))
    rest = axes.rest * short[axes.owner]
    strain = length / rest - 1
    stiff = axes.stiffness * np.where(strain < 0, _SLACK, 1.0) * alive[axes.owner]
    pull = (stiff * strain / np.maximum(length, 1e-9))[:, None] * d
    bed = (axes.bed * alive[axes.muscle])[:, None] * (aim - x)
    energy = 0.5 * float(stiff @ (rest * strain**2)) + 0.5 * float(np.einsum("ij,ij->", bed, aim - x))
    node = np.where(axes.node < 0, axes.count, axes.node)  # the last row collects what bone bears
    at = np.concatenate([node[axes.first], node[axes.second], node])
    all_forces = np.concatenate([pull, -pull, bed])
    force = np.stack([np.bincount(at, all_forces[:, k], minlength=axes.count + 1) for k in range(3)], axis=1)
    return energy, force[:-1]


def net_stiffness(axes: Axes, contraction, parameters: Parameters) -> np.ndarray:
    """(q,) a bound on the stiffness about each node."""
    alive = 1 + parameters.active * np.append(contraction, 0.0)
    short = 1 - np.append(axes.shortening * contraction, 0.0)
    spring = axes.stiffness * alive[axes.owner] / (axes.rest * short[axes.owner])
    node = np.where(axes.node < 0, axes.count, axes.node)
    at = np.concatenate([node[axes.first], node[axes.second], node])
    total = np.bincount(at, np.concatenate([spring, spring, axes.bed * alive[axes.muscle]]), minlength=axes.count + 1)
    return total[:-1]


def settled(axes: Axes, posed, aim, contraction, parameters: Parameters, tolerance: float = 0.005) -> np.ndarray:
    """(s, 3) mm: the axes at rest under ``contraction`` (m,); to be compared with ``aim`` (s, 3)."""
    moved, _, _ = relax(
        lambda u: net_force(axes, posed, aim, contraction, parameters, u)[1],
        np.zeros((axes.count, 3)),
        net_stiffness(axes, contraction, parameters),
        tolerance,
        2000,
    )
    return axis_positions(axes, posed, moved)
