# SPDX-License-Identifier: GPL-3.0-or-later
"""Shut lids meet: what the tissue holds them apart at rest is made good by turning them over the eyeball.

The targets of closed lids meet where they are drawn (`lids`), but skin that hangs on brow and cheek gives the springs
that take the lids there some tenths of a millimetre, and an eyeball shows through no more than that.
"""

import numpy as np

from .structures import Model

#: Share of the whole way from which on lids count as shut more and more; mm by which they come to overlap; rounds.
FROM, OVERLAP, ROUNDS = 0.9, 0.03, 4
#: mm of gap that is made good, at most.
MOST = 1.5


def shut_share(lids, closure) -> float:
    """0..1: how far lids that close by ``closure`` (upper, lower) count as shut."""
    lower = float(np.median(lids.lower_share))
    closed = (1 - lower) * float(closure[0]) + lower * float(closure[1])
    return float(np.clip((closed - FROM) / (1 - FROM), 0, 1))


def met(model: Model, shut, positions) -> np.ndarray:
    """(3 n, 3) mm: ``positions`` with the drawn edges of shut lids turned onto each other.

    shut : (2,) `shut_share` of the left and the right eye
    """
    for lids in model.lids:
        share = shut["lr".index(lids.side)]
        if share > 0 and lids.edge is not None:
            positions = _met(lids, share, positions)
    return positions


def _met(lids, share, positions):
    positions = positions.copy()
    column, eye = lids.column, lids.eye
    way = np.where(lids.upper, -0.5, 0.5) * lids.weight * (lids.opening > 0.02) * share
    left = np.full(len(column), MOST / eye.radius)
    for _ in range(ROUNDS):
        gap = lids.edge.gap(positions, lids.upper, lids.within)
        turn = np.clip(gap + OVERLAP / eye.radius, 0, left)
        if not turn.any():
            break
        left = left - turn
        angle = way * turn
        rel = positions[column] - eye.centre
        forward, up = rel @ lids.forward, rel @ lids.up
        cos, sin = np.cos(angle) - 1, np.sin(angle)
        positions[column] += (cos * forward - sin * up)[:, None] * lids.forward
        positions[column] += (sin * forward + cos * up)[:, None] * lids.up
    return positions
