# SPDX-License-Identifier: GPL-3.0-or-later
"""Springs of the layered tissue: Lee, Terzopoulos and Waters 1995, 3.1 and 3.3.

Force on a node: g = c (l - l_rest) s, with s the unit vector along the spring. The dermal-fatty layer is biphasic:
beyond a stretch of ``limit`` the slope is the second constant. All forces are gradients of one energy, so they do no
net work on a closed path and their momentum is zero.
"""

import numpy as np
from scipy import sparse

from ..mesh import edges
from .axes import per_axis
from .parameters import Parameters
from .structures import Layers, Springs

#: The five kinds of 3.1 and 3.10, the dermal-fatty one with its crossed diagonals.
KINDS = ("epidermis", "dermal_fatty", "dermal_fatty_cross", "fascia", "muscle_layer", "muscle_layer_cross", "sheet_tie")


def build_springs(faces: np.ndarray, layers: Layers, parameters: Parameters, ties: np.ndarray) -> Springs:
    """All springs of the prisms over ``faces`` (m, 4), and ties (p, 2) between fascia columns of the two faces of a
    lip.

    Quads get both diagonals in their layers, prism sides are crossed (one diagonal a side converges badly).
    """
    n = len(layers.area)
    side = edges(faces)
    quads = faces[faces[:, 3] >= 0]
    diagonal = np.concatenate([quads[:, [0, 2]], quads[:, [1, 3]]]) if len(quads) else np.zeros((0, 2), int)
    sheet = np.unique(np.sort(np.concatenate([side, diagonal]), axis=1), axis=0)
    column = np.arange(n)
    valence = np.maximum(np.bincount(side.ravel(), minlength=n), 1)
    share = (layers.area / valence)[side].sum(axis=1) / 2  # mm² per edge, for each of its two crossed diagonals
    scale = 1 / parameters.element_area
    groups = []

    def add(kind, a, b, c, c2=None, limit=np.inf):
        c = np.broadcast_to(np.asarray(c, float), a.shape)
        groups.append((a, b, np.full(len(a), kind), c, c if c2 is None else c2, np.full(len(a), limit)))

    p = parameters
    loose = np.sqrt(layers.sheet[sheet].prod(axis=1))
    add(0, sheet[:, 0], sheet[:, 1], p.epidermis * loose)
    across = layers.area * scale
    limit = p.biphasic_strain
    add(1, column, column + n, p.dermal_fatty * across, p.dermal_fatty_stiff * across, limit)
    cross = share * scale
    for a, b in ((side[:, 0], side[:, 1]), (side[:, 1], side[:, 0])):
        add(2, a, b + n, p.dermal_fatty * cross, p.dermal_fatty_stiff * cross, limit)
    add(3, sheet[:, 0] + n, sheet[:, 1] + n, p.fascia * loose)
    add(4, column + n, column + 2 * n, p.muscle_layer * across * layers.soften)
    soft = layers.soften[side].mean(axis=1)
    for a, b in ((side[:, 0], side[:, 1]), (side[:, 1], side[:, 0])):
        add(5, a + n, b + 2 * n, p.muscle_layer * cross * soft)
    if len(ties):
        add(6, ties[:, 0] + n, ties[:, 1] + n, p.dermal_fatty * layers.area[ties].mean(axis=1) * scale)
    first, second, kind, stiffness, stiff, limits = (np.concatenate(part) for part in zip(*groups, strict=True))
    movable = np.concatenate([layers.free, np.zeros(n, bool)])
    keep = movable[first] | movable[second]
    return assemble(layers.nodes, first[keep], second[keep], kind[keep], stiffness[keep], stiff[keep], limits[keep])


def assemble(nodes, first, second, kind, stiffness, stiff, limit) -> Springs:
    """Springs at rest in ``nodes`` (k, 3) between node indices ``first`` and ``second`` (s,)."""
    first, second = np.asarray(first), np.asarray(second)
    rest = np.linalg.norm(nodes[second] - nodes[first], axis=1)
    s = len(first)
    row = np.arange(s)
    difference = sparse.csr_matrix(
        (np.concatenate([np.ones(s), -np.ones(s)]), (np.tile(row, 2), np.concatenate([second, first]))),
        (s, len(nodes)),
    )
    rest = np.maximum(rest, 1e-3)
    gather = difference.T.tocsr()
    two = np.flatnonzero(stiff > stiffness)
    biphasic = slice(two[0], two[-1] + 1) if len(two) else slice(0)
    return Springs(first, second, kind, rest, stiffness, stiff, limit, biphasic, difference, gather)


def spring_forces(springs: Springs, x: np.ndarray, out=None) -> tuple[float, np.ndarray]:
    """Energy and g of each spring (3, s), the force on its first node (3.3); ``x`` (3, k) mm, axis by axis."""
    # mode="clip" writes without a buffer; no index is out of range
    d = x.take(springs.second, axis=1, mode="clip")
    d -= x.take(springs.first, axis=1, mode="clip")
    spare = d * d
    length, stretch, tension = spare
    length += stretch
    length += tension
    np.sqrt(length, out=length)
    np.subtract(length, springs.rest, out=stretch)
    np.multiply(springs.stiffness, stretch, out=tension)
    energy = float(tension @ stretch)
    two = springs.biphasic
    beyond = np.maximum(stretch[two] - springs.limit[two] * springs.rest[two], 0)
    extra = (springs.stiff[two] - springs.stiffness[two]) * beyond
    tension[two] += extra
    tension /= np.maximum(length, 1e-9, out=length)
    return 0.5 * (energy + float(extra @ beyond)), np.multiply(d, tension, out=spare if out is None else out)


def spring_energy(springs: Springs, positions: np.ndarray) -> tuple[float, np.ndarray]:
    """Energy and its gradient (k, 3), the net of -g over each node (3.3); ``positions`` (k, 3) mm."""
    energy, force = spring_forces(springs, np.ascontiguousarray(positions.T))
    return energy, per_axis(springs.gather, force).T
