# SPDX-License-Identifier: GPL-3.0-or-later
"""Fibres as control polygons that shorten along themselves (Kähler et al. 2001, taken over by 2002, section 3).

A fibre is a polygon p_0 ... p_k, fixed at p_0, with parameters t_i = (length up to p_i) / (whole length). Contracted by c,
point i goes to where the polygon has the parameter (1 - c) t_i: the fibre slides along its own rest shape.
"""

import numpy as np


def arc_lengths(points: np.ndarray, start: np.ndarray) -> np.ndarray:
    """(k,) mm from the first point of its polygon along polygons laid end to end; ``start`` (k,) bool marks the firsts."""
    step = np.zeros(len(points))
    step[1:] = np.linalg.norm(np.diff(points, axis=0), axis=1)
    step[start] = 0
    total = np.cumsum(step)
    begin = np.flatnonzero(start)
    return total - np.repeat(total[begin], np.diff(np.append(begin, len(points))))


def on_polygons(points: np.ndarray, along: np.ndarray, start: np.ndarray, fibre: np.ndarray, wanted: np.ndarray):
    """Points (k, 3) of polygon ``fibre`` (k,) at ``wanted`` (k,) mm from its root, and the unit tangents (k, 3) there.

    Past its end a polygon goes on straight. points (p, 3), along (p,), start (p,): the polygons, end to end.
    """
    begin = np.flatnonzero(start)
    last = np.append(begin[1:], len(points)) - 1
    gap = 1.0 + along[last].max(initial=0.0)  # each polygon has an interval of its own on one long ruler
    owner = np.repeat(np.arange(len(begin)), last - begin + 1)
    ruler = along + 2 * gap * owner
    seek = np.clip(wanted, 0, along[last][fibre]) + 2 * gap * fibre
    low = np.clip(np.searchsorted(ruler, seek, side="right") - 1, begin[fibre], last[fibre] - 1)
    step = points[low + 1] - points[low]
    length = np.maximum(np.linalg.norm(step, axis=1), 1e-9)
    tangent = step / length[:, None]
    return points[low] + (np.maximum(wanted, 0) - along[low])[:, None] * tangent, tangent


def contracted(points, along, start, fibre, contraction):
    """Where points (k, 3) of linear fibres go when contracted by ``contraction`` (k,), and how their tangents turn.

    Returns (k, 3) mm and (k, 3) rotation vectors (axis times sine of the angle) from the tangent there was to the one
    there is. fibre (k,): the polygon of each point.
    """
    here, now = on_polygons(points, along, start, fibre, (1 - contraction) * along)
    before = on_polygons(points, along, start, fibre, along)[1]
    return here, np.cross(before, now)
