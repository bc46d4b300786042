# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a scanner's axis would stand in a head: amid the whole head, or as far behind a face as that would be."""

import numpy as np

#: Radius and its spread of the level outline of heads at the eyes and the ears, mm.
ROUND, SPREAD = 86.0, 6.0
#: The part of a bust that is head, from the top, mm.
HEAD = 230.0


def upright_axis(points: np.ndarray) -> np.ndarray:
    """(3,) mm: a point of the vertical axis, at height 0, for ``points`` (n, 3) mm of an upright head, face or bust.

    A circle is laid on the level outline by least squares; how large heads are decides where the data is a mere arc.
    """
    points = points[np.isfinite(points).all(axis=1)]
    top = points[:, 2].max()
    head = points[points[:, 2] > top - HEAD]
    plan = head[:: max(len(head) // 20_000, 1), :2]
    # A back of the head, if there is one, begins the search amid the head; a face alone has its middle before the axis.
    low, high = plan.min(axis=0), plan.max(axis=0)
    centre = np.array([(low[0] + high[0]) / 2, min((low[1] + high[1]) / 2, low[1] + 1.35 * ROUND)])
    centre[1] = max(centre[1], low[1] + ROUND)
    radius = ROUND
    for _ in range(20):
        off = plan - centre
        length = np.maximum(np.linalg.norm(off, axis=1), 1e-6)
        weight = 1 / (1 + ((length - radius) / 20.0) ** 2)  # the nose, ears and neck lie off any circle
        slope = np.column_stack([-off / length[:, None], -np.ones(len(off))]) * np.sqrt(weight)[:, None]
        miss = (length - radius) * np.sqrt(weight)
        normal = slope.T @ slope
        pull = -slope.T @ miss
        prior = len(plan) / SPREAD**2 * 4.0
        normal[2, 2] += prior
        pull[2] += prior * (ROUND - radius)
        move = np.linalg.solve(normal + 1e-9 * np.eye(3), pull)
        centre, radius = centre + move[:2], radius + move[2]
        if np.abs(move).max() < 1e-3:
            break
    # Never outside what was scanned, whatever it is.
    return np.array([*np.clip(centre, low - ROUND, high + ROUND), 0.0])
