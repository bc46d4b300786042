# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangular prism elements over bone: Lee, Terzopoulos and Waters 1995, 3.1 and 3.2, figure 6(a).

Each triangle of the skin stands over nine nodes: 1 2 3 of the epidermis, 4 5 6 of the fascia, 7 8 9 on the skull. Springs
join them within the epidermis and the fascia and between the layers, across each face of the prism in both directions
(with one diagonal a face the layers shear to one side). Springs that elements share are there once.
"""

import numpy as np
from scipy import sparse

from ...mesh import edges
from ..springs import assemble
from ..structures import Springs
from ..volume import corner_gather, prism_volumes
from .constants import Constants
from .structures import Elements

#: The kinds of springs, in the order of `Springs.kind`: the five of 3.10 (the dermal-fatty one has two phases), and ties
#: through the flesh of lips and lids, which have skin on both sides.
EPIDERMIS, DERMAL_FATTY, FASCIA, MUSCLE_LAYER, TIE = range(5)


def build_springs(
    triangles: np.ndarray,
    nodes: np.ndarray,
    moving: np.ndarray,
    constants: Constants,
    ties: np.ndarray,
    soften: np.ndarray | None = None,
    sheet: np.ndarray | None = None,
) -> Springs:
    """All springs of the prisms over ``triangles`` (t, 3), at rest.

    nodes : (3 n, 3) mm, epidermis, fascia, skull; moving (3 n,) bool: springs between nodes that never move are left out
    ties : (p, 2) columns back to back, joined by springs as of the dermal-fatty layer
    soften : (n,) factor on the muscle-layer springs: the paper's number holds over bone, not in lips and cheeks
    sheet : (n,) factor on the springs along the layers: skin that lies in folds (lids) or lines the mouth gives way
    """
    n = len(nodes) // 3
    side = edges(np.concatenate([triangles, np.full((len(triangles), 1), -1, triangles.dtype)], axis=1))
    a, b = side.T
    column = np.arange(n)
    c = constants
    soft = np.ones(n) if soften is None else soften
    across = c.muscle_layer * soft[side].mean(axis=1)
    loose = np.ones(len(side)) if sheet is None else np.sqrt(sheet[side].prod(axis=1))
    rows = [
        (EPIDERMIS, a, b, c.epidermis * loose),
        (DERMAL_FATTY, column, column + n, c.dermal_fatty),
        (DERMAL_FATTY, a, b + n, c.dermal_fatty),
        (DERMAL_FATTY, b, a + n, c.dermal_fatty),
        (FASCIA, a + n, b + n, c.fascia * loose),
        (MUSCLE_LAYER, column + n, column + 2 * n, c.muscle_layer * soft),
        (MUSCLE_LAYER, a + n, b + 2 * n, across),
        (MUSCLE_LAYER, b + n, a + 2 * n, across),
        (TIE, ties[:, 0] + n, ties[:, 1] + n, c.dermal_fatty),
    ]
    first, second = (np.concatenate([row[k] for row in rows]) for k in (1, 2))
    kind = np.repeat([row[0] for row in rows], [len(row[1]) for row in rows])
    stiffness = np.concatenate(
        [np.broadcast_to(float(row[3]) if np.isscalar(row[3]) else row[3], row[1].shape) for row in rows]
    )
    stiff = np.where(kind == DERMAL_FATTY, c.dermal_fatty_stiff, stiffness)
    limit = np.where(kind == DERMAL_FATTY, c.biphasic_strain, np.inf)
    keep = moving[first] | moving[second]
    return assemble(nodes, *(x[keep] for x in (first, second, kind, stiffness, stiff, limit)))


def build_elements(triangles: np.ndarray, nodes: np.ndarray, moving: np.ndarray) -> Elements:
    """The prisms over ``triangles`` (t, 3) that can move. Nodes and ``moving`` as in `build_springs`."""
    n = len(nodes) // 3
    prisms = np.concatenate([triangles, triangles + n], axis=1)
    volume = prism_volumes(nodes, prisms)
    # a sharp fold of the skin presses a prism flat or inside out: it has no volume to preserve
    prisms = prisms[moving[prisms].any(axis=1) & (volume > 0)]
    volume = volume[moving[np.concatenate([triangles, triangles + n], axis=1)].any(axis=1) & (volume > 0)]
    t = len(prisms)
    row = np.arange(t)
    epidermal = sparse.csr_matrix((np.ones(3 * t), (prisms[:, :3].ravel(), np.repeat(row, 3))), (n, t))
    belongs = sparse.csr_matrix((np.ones(6 * t), (prisms.ravel(), np.repeat(row, 6))), (3 * n, t))
    about = sparse.diags(np.asarray(belongs.sum(axis=1)).ravel()) - belongs @ belongs.T / 6
    return Elements(prisms, volume, epidermal, corner_gather(prisms, 3 * n), about.tocsr())
