# SPDX-License-Identifier: GPL-3.0-or-later
"""How a face is looked for in a scan: at first a quick look, then ever more thorough ones."""

from dataclasses import dataclass, replace

import numpy as np

from .pose_search import STARTS, SURVIVORS


@dataclass(frozen=True)
class Look:
    """One look for a face.

    infant : whether it is an infant's face that is looked for
    half : whether it is one half of a face, either one, all that a scan from the side shows
    above : whether only what lies above a beard, and the lips, are
    size : of the reference's, the face that is looked for to begin with
    starts, survivors : see `search_poses`
    tried : placements that are looked at closely
    most, worse : how many of them are followed, and how much worse than the best these may fit at first
    further : how many are, whatever they fit like, while none shows a face
    again : how many of those are begun again, the first of them and, while none shows a face, others
    relief : correlation with the relief of a face that is enough. Faces have 0.66 and more, most of them 0.8; balls, boxes
        and backs of heads 0.4; the best of many places where none is, 0.6.
    weigh : power of that correlation by which a placement's misfit is divided when the likeliest are chosen. A face seen from
        above fits worse than the top of its head, round and whole, on which any dome of a forehead lies.
    """

    infant: bool
    half: bool
    above: bool
    size: float
    starts: int
    survivors: int
    tried: int
    most: int
    worse: float
    further: int
    again: int
    relief: float
    weigh: float


#: The first shows most faces. The second, for half of one, is taken if it shows no plain face or little of one. If there is
#: no plain face yet the third is, a thorough one, which begins with a small face, because a large one on a small head finds
#: no hold. If that shows none, an infant's is looked for, and then one that is bearded or muffled up.
QUICK = (
    Look(False, False, False, 1.0, STARTS, SURVIVORS, 10, 3, 1.25, 5, 2, 0.53, 0.0),
    Look(False, True, False, 1.0, STARTS, SURVIVORS, 4, 2, 1.25, 2, 1, 0.7, 2.0),
)
THOROUGH = Look(False, False, False, 0.8, 1000, 400, 14, 4, np.inf, 4, 4, 0.7, 2.0)
LOOKS = (
    *QUICK,
    THOROUGH,
    Look(True, False, False, 0.7, 1000, 400, 14, 4, np.inf, 4, 4, 0.7, 2.0),
    Look(False, False, True, 1.0, STARTS, SURVIVORS, 10, 3, 1.25, 5, 2, 0.8, 2.0),
)
#: The first, but shorter, for a face that may have any size: it is taken at many.
ANY_SIZE = replace(LOOKS[0], tried=4, most=2, further=3, again=1)
#: Shares of the work at which trials of each look begin, and its fits begin and end. Between the first and the second a face
#: may be looked for in any size.
PARTS = ((0.0, 0.4, 0.55), (0.72, 0.73, 0.75), (0.75, 0.82, 0.86), (0.86, 0.91, 0.94), (0.94, 0.96, 0.98))
SIZED, ODDLY_SIZED = 0.7, 0.72  # shares at which that is done, and the same for a body or a room
MIDDLE = 6.0  # mm: so far half a face goes beyond the middle
WHOLE = 0.65  # share of a face that finds the scan, below which half of one is looked for as well
PLAIN = 0.66  # relief from which on a quick look is enough: faces have as much
CLEAR = 0.75  # relief from which on nothing better is looked for


def templates_of(look: Look, template: np.ndarray) -> list[np.ndarray]:
    """What of a face, ``template`` (k, 3) mm, is laid on a scan in a ``look``: all of it, or its left and its right half."""
    if not look.half:
        return [template]
    return [template[side * template[:, 0] > -MIDDLE] for side in (1.0, -1.0)]
