# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference with its lids shut: what a scan of closed eyes is fitted with, so that lids meet as lids do."""

from functools import lru_cache

import numpy as np

from ..anatomy.head import Head

#: Share of the lids' way at which their margins just meet.
MEET = 0.97


@lru_cache(maxsize=4)
def with_shut_eyes(reference: Head, sides: tuple[str, ...]) -> Head:
    """``reference`` with the lids of the ``sides`` (``l``, ``r``) turned shut over the eyeballs, by no muscle."""
    from ..acting.plain_posing import plainly_posed
    from .rest import rest_of

    shut = plainly_posed(reference, blink=tuple(MEET * (side in sides) for side in "lr"))
    rest, skin = rest_of(reference), shut.skin.vertices
    hidden = rest.inner | rest.rim
    for eye, side in zip(shut.eyes, "lr", strict=True):
        if side in sides:
            skin = np.where(hidden[:, None], rest.contacts[side].settled(skin, eye), skin)
    return shut.with_vertices({"skin": skin})
