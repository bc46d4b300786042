# SPDX-License-Identifier: GPL-3.0-or-later
"""The edge of the upper incisors between parted lips: the one thing in an open mouth that no expression moves.

Where closed lips meet is known from it, as people show about as much of these teeth under resting lips (Vig and Brundo
1978, The kinetics of anterior tooth display).
"""

import numpy as np

from ..adapt.closest import Surface
from ..anatomy.head import Head
from .mouth_gap import EATEN, MARKS, SPECK, STEP, STEPS, profiles

SHARES = np.linspace(-0.3, 0.3, 25)  # of the way from the middle of the mouth to its corners: incisors
FEWEST = 8  # lines with an edge
SHADE = 6.0  # mm under the upper lip that it may hide
CROWN = (1.8, 13.0)  # mm of a tooth that are seen
BEHIND = (-1.0, 12.0)  # mm that teeth lie behind the lip
CLEAR = 2.0  # mm from the edge of the teeth to the lower lip: on the lip, it is not seen
STRAY = 1.0  # mm: edges lie in a line, but for half of them
#: Deviation of the place where lips meet, seen from these teeth, mm: to the side they say nothing; by the lip's thickness;
#: by what shows of the teeth (our own estimates).
TOLD = (1e3, 2.0, 1.5)


def incisal_edge(target: Surface, given, forward) -> np.ndarray:
    """(k, 3) mm on the edge of the upper incisors that the scan shows; none where it does not.

    given : landmarks, name -> (3,) mm, on the lips as scanned; forward : (3,) unit vector, out of the face
    """
    if any(name not in given for name in MARKS):
        return np.zeros((0, 3))
    lines, depth = profiles(target, given, forward, SHARES)
    out = []
    for line, behind in zip(lines, depth, strict=True):
        at = end_of_teeth(behind, np.linalg.norm(line[-1] - line[0]) / (STEPS - 1))
        if at is not None:
            down = (line[-1] - line[0]) / np.linalg.norm(line[-1] - line[0])
            out.append(line[at] - behind[at] * forward + EATEN * np.isnan(behind[at + 1]) * down)
    return np.array(out) if len(out) >= FEWEST else np.zeros((0, 3))


def end_of_teeth(depth: np.ndarray, step: float) -> int | None:
    """On a line from lip to lip, ``step`` mm between its places: the last place of the teeth that hang behind the upper
    lip, clear of the lower one.

    depth (k,) mm, NaN where there is nothing
    """
    there = np.flatnonzero(np.isfinite(depth))
    breaks = (np.diff(there) > max(1, int(SPECK / step))) | (np.abs(np.diff(depth[there])) > STEP)
    runs = np.split(there, np.flatnonzero(breaks) + 1)
    if len(runs) < 3:
        return None
    lip = runs[0]
    for run in runs[1:-1]:
        seen, shade, clear = (
            step * (b - a) for a, b in ((run[0], run[-1] + 1), (lip[-1], run[0]), (run[-1], runs[-1][0]))
        )
        behind = depth[run].mean() - depth[lip[-3:]].mean()
        if CROWN[0] <= seen <= CROWN[1] and shade <= SHADE and clear >= CLEAR and BEHIND[0] < behind < BEHIND[1]:
            return int(run[-1])
    return None


def told_of_stomion(reference: Head, edge) -> np.ndarray | None:
    """(3,) mm by which the upper incisors with the ``edge`` (k, 3) mm, laid on the reference, lie beside its own: where lips
    meet, relative to the reference's, within `TOLD`. None: there is no edge, or it is no straight one.
    """
    if len(edge) == 0:
        return None
    teeth = reference.parts["teeth_upper"].vertices
    own = np.empty_like(edge)
    for k, x in enumerate(edge[:, 0]):
        beside = teeth[np.abs(teeth[:, 0] - x).argsort()[: max(8, len(teeth) // 40)]]
        low = beside[:, 2].min()
        own[k] = x, beside[beside[:, 2] < low + 1.5, 1].min(), low
    beside = edge - own
    middle = np.median(beside, axis=0)
    return middle if np.median(np.abs(beside[:, 2] - middle[2])) < STRAY else None
