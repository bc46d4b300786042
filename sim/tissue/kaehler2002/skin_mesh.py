# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin as a mass-spring mesh (Kähler et al. 2002, section 3 and 4.2): its edges are springs, its vertices point
masses, more springs lead to what lies under it and keep the volume of the tissue.

Springs: edges and diagonals of the skin, biphasic as in Lee et al. 1995, 3.3; from each vertex to its foot on muscle or
bone; from each vertex to the foot's mirror image outside the skin (2001), which resists being pressed in or pulled off as
the first resists the opposite, but leaves the skin free to slide a little; struts to the feet of neighbouring vertices,
our own, so that sliding is resisted from the start. ``assemble`` and the forces are those of the other solver here.
"""

import numpy as np

from ...mesh import edges
from ..springs import assemble
from ..structures import Layers, Springs
from .parameters import Parameters
from .structures import Attachments

#: Kinds of springs, indices into `Springs.kind`.
KINDS = ("skin", "attachment", "mirrored", "strut", "tie")


def mirrored(skin, foot) -> np.ndarray:
    """The foot's mirror image through the skin vertex, outside."""
    return 2 * skin - foot


def build_skin_mesh(faces, skin, attachments: Attachments, layers: Layers, ties, parameters: Parameters) -> Springs:
    """Springs over 3 n nodes: skin, feet, mirrored feet. ties (p, 2): skin vertices back to back through a lip."""
    n, p = len(skin), parameters
    nodes = np.concatenate([skin, attachments.foot, mirrored(skin, attachments.foot)])
    side = edges(faces)
    quads = faces[faces[:, 3] >= 0]
    sheet = np.concatenate([side, quads[:, [0, 2]], quads[:, [1, 3]]])
    sheet = np.unique(np.sort(sheet, axis=1), axis=0)
    loose = np.sqrt(layers.sheet[sheet].prod(axis=1))
    column = np.arange(n)
    hold = layers.area * attachments.stiffness
    valence = np.maximum(np.bincount(side.ravel(), minlength=n), 1)
    strut = p.strut_area * (hold / valence)[side].mean(axis=1)
    none = np.inf
    groups = [
        (0, sheet[:, 0], sheet[:, 1], p.skin * loose, p.skin_stiff * loose, p.strain),
        (1, column, column + n, p.attachment_area * hold, None, none),
        (2, column, column + 2 * n, p.attachment_area * hold, None, none),
        (3, side[:, 0], side[:, 1] + n, strut, None, none),
        (3, side[:, 1], side[:, 0] + n, strut, None, none),
        (4, ties[:, 0], ties[:, 1], p.attachment_area * layers.area[ties].mean(axis=1), None, none),
    ]
    first, second = (np.concatenate([g[i] for g in groups]) for i in (1, 2))
    kind = np.concatenate([np.full(len(g[1]), g[0]) for g in groups])
    stiffness = np.concatenate([g[3] for g in groups])
    stiff = np.concatenate([g[3] if g[4] is None else g[4] for g in groups])
    limit = np.concatenate([np.full(len(g[1]), g[5]) for g in groups])
    movable = np.concatenate([layers.free[:n], np.zeros(2 * n, bool)])
    keep = movable[first] | movable[second]
    return assemble(nodes, first[keep], second[keep], kind[keep], stiffness[keep], stiff[keep], limit[keep])


def about_nodes(springs: Springs, count: int) -> np.ndarray:
    """(count,) a bound on the stiffness that springs lend each of the first ``count`` nodes."""
    most = np.maximum(springs.stiffness, springs.stiff)
    both = np.concatenate([springs.first, springs.second])
    return np.bincount(both, np.tile(most, 2), minlength=count)[:count]
