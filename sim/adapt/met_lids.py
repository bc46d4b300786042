# SPDX-License-Identifier: GPL-3.0-or-later
"""Lids that were scanned shut lie on each other: the surfaces drawn of both margins meet from corner to corner.

A scanner sees no more than a crevice where lids meet, so the fit leaves a slit or an overlap of up to a millimetre there.
Either lid is turned about the axis through the corners of the eye, half of the way each; what lies behind and before
the margin goes with it, less and less.
"""

from typing import TYPE_CHECKING

import numpy as np

from ..anatomy.head import Eye
from ..mesh import edges
from ..tissue.lid_edges import LidEdge, strips

if TYPE_CHECKING:
    from .rest import Rest

#: mm from the margin over which its turn dies away: on the seen skin, behind it.
BEFORE, BEHIND = 6.0, 5.0
#: mm between the drawn margins that is aimed at as they are measured vertex by vertex (between them they reach less far),
#: rounds, and what share of the way is gone in each.
APART, ROUNDS, STEP = -0.1, 10, 0.6
#: Share of the lids' length at either corner over which they stay as they are.
CORNER = 0.04
#: Edges behind the margins that count as such.
UNSEEN = 2
#: rad by which a lid turns at most.
MOST = 0.2


class LidSlit:
    """The slit between the lids of the eye ``side`` of the reference, as `met` closes it.

    hidden : (n,) bool, the inner edges of the margins and the lids' backs behind them, which no scan of shut eyes shows
    """

    def __init__(self, rest: "Rest", side: str):
        head = rest.head
        self.head, self.side = head, side
        upper, lower = (np.asarray(head.groups[f"lid_{x}_{side}"], dtype=float) for x in ("upper", "lower"))
        self.column = np.flatnonzero(np.maximum(upper, lower) > 0.01)
        self.upper = (upper >= lower)[self.column]
        self.inner = rest.inner[self.column]
        self.edge = rest.rim[self.column] & (np.maximum(upper, lower)[self.column] > 0.4)
        self.pair = edges(head.skin.faces)
        self.hidden = np.isin(np.arange(len(upper)), self.column[self.edge])
        self.hidden[rest.organs[f"eye_{side}"]] = rest.behind[rest.organs[f"eye_{side}"]] <= UNSEEN

    def met(self, skin, eye: Eye, marks) -> np.ndarray:
        """Skin (n, 3) mm with the slit between the lids closed.

        marks : name -> (3,) mm, landmarks of that skin
        """
        inner, outer = marks[f"en_{self.side}"], marks[f"ex_{self.side}"]
        axis = (outer - inner) / np.linalg.norm(outer - inner)
        forward = eye.gaze - (eye.gaze @ axis) * axis
        forward /= np.linalg.norm(forward)
        frame = np.stack([axis, forward, np.cross(forward, axis)])
        frame[2] *= np.sign(frame[2, 2])
        edge = LidEdge(self.head.with_vertices({"skin": skin}), self.column, self.edge, self.inner, frame, eye.centre)
        root, length = strips(self.pair, self.column, edge.rows, skin)
        share = np.clip(1 - length / np.where(self.inner, BEHIND, BEFORE), 0, 1)
        share = np.where(root >= 0, share * share * (3 - 2 * share), 0)
        upper = self.upper[edge.rows]
        local = (skin[self.column] - eye.centre) @ frame.T
        turn, out = np.zeros(len(self.column)), np.array(skin, dtype=float)
        for _ in range(ROUNDS):
            at, level = edge.reach(out, self.upper)
            place = np.where(root >= 0, at[root], local[:, 0])
            ends = (place - at.min()) / np.ptp(at)
            ends = np.clip(np.minimum(ends, 1 - ends) / CORNER, 0, 1)
            gap = _along(at[upper], level[upper], place) - _along(at[~upper], level[~upper], place)
            turn = np.clip(turn + STEP * ends * (gap - APART / eye.radius) / 2, -MOST, MOST)
            angle = share * turn * np.where(self.upper, -1, 1)
            cosine, sine = np.cos(angle), np.sin(angle)
            turned = [local[:, 0], cosine * local[:, 1] - sine * local[:, 2], sine * local[:, 1] + cosine * local[:, 2]]
            out[self.column] = eye.centre + np.stack(turned, axis=1) @ frame
        return out


def _along(x, y, at):
    order = np.argsort(x, kind="stable")
    return np.interp(at, x[order], y[order])
