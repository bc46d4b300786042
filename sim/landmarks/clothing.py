# SPDX-License-Identifier: GPL-3.0-or-later
"""Clothes about the neck, as a scan's colours tell: a collar or a hood is no skin, and has not its colour.

Below the jaw of a plausible head laid on the scan, what differs from the face's skin by more than shade, in one piece down to
where the scan ends, is clothing; so is what that cuts off from the head. Shade changes how light skin is and little else: what
counts is the hue, and that it is darker than shade makes skin.
"""

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from ..adapt.closest import Surface
from ..mesh import Mesh
from ..scan.colour_space import LUMINANCE, to_linear
from .hidden_skin import hidden_skin
from .shape_fit import ShapeFit
from .shape_space import ShapeSpace
from .things import pieces

if TYPE_CHECKING:
    from .laid_head import LaidHead

#: mm, all on a head of the reference's size.
BELOW = -4.0  # above the chin, to which clothes rise
BEHIND, NAPE = 15.0, 18.0  # that far behind the ears they rise to so far above it
ON_SKIN = 4.0  # to which the scan shows the face's skin
AROUND = 2.5  # over which colours are averaged
EDGE = 6.0  # beside clothes: their edges, and their shade on the skin
LEAST = 400.0  # mm² of a piece
END = 20.0  # above the lowest of the scan, to which it ends
UNDER = 20.0  # behind clothes, to which they hide skin
#: How unlike skin, as a logarithm, the ratios of green and blue to red are at least, in terms of what grey is, and of what half
#: of the face is; how much darker than it, as a logarithm of light, no skin is. Of one man in warm light, for whom grey is
#: 1.36, the throat is .5 and the collar 1.1 to 1.4.
UNLIKE, AS_GREY, OWN, DARKER = 0.35, 0.6, 3.0, -2.6
BLACK = 0.002  # linear light, beneath which colours are noise
FEWEST = 50  # vertices that skin's colour is learnt from
BLANK = 0.999  # sRGB: white that stands for no colour


def clothing_over(space: ShapeSpace, fit: ShapeFit, target: Surface, scan: Mesh | None) -> np.ndarray:
    """(m,) bool: the triangles of ``target`` that show clothes, and what lies just beside them; none without colours.

    scan : vertices, mm, where the target's are, and their colours
    """
    none = np.zeros(len(target.triangles), dtype=bool)
    if scan is None or scan.colour is None or not len(target.triangles):
        return none
    size = fit.pose.scale
    light, seen = _colours(target, scan, size)
    unlike = _unlike_skin(space, fit, target, light, seen)
    low = np.flatnonzero(_may_be(space, fit, target.vertices))
    if unlike is None or not len(low):
        return none
    some = np.zeros(len(target.vertices), dtype=bool)
    some[low] = unlike(light[low])
    piece, area = pieces(target, some)
    reaching = np.zeros(len(area), dtype=bool)
    height = target.vertices @ fit.pose.turn[:, 2]
    reaching[piece[some & (height < height[target.triangles].min() + END * size)]] = True
    reaching[piece[some & target.border_vertex]] = True
    some &= (reaching & (area > LEAST * size**2))[piece]
    if not some.any():
        return none
    some[low] |= cKDTree(target.vertices[some]).query(target.vertices[low])[0] < EDGE * size
    some |= _cut_off(target, some, low)
    return some[target.triangles].any(axis=1)


def under_clothing(head: "LaidHead", left: Surface) -> np.ndarray:
    """(n,) bool: the points of the ``head``'s skin that lie under clothing, and that the scan without it, ``left``, lacks."""
    clothes = head.clothing.vertices[head.clothing.triangles.ravel()]
    return hidden_skin(head.space, head.fit, clothes, left, UNDER)


def _colours(target, scan, size):
    """Logarithms (n, 3) of the linear colours about the vertices of ``target``, and (n,) bool whether there are any."""
    colour = np.asarray(scan.colour, dtype=float)
    known = ~(colour >= BLANK).all(axis=1)
    if not known.any():
        return np.zeros((len(target.vertices), 3)), np.zeros(len(target.vertices), dtype=bool)
    tree = cKDTree(scan.vertices[known])
    away, near = tree.query(target.vertices, k=6, workers=-1)
    weight = np.exp(-((away / (AROUND * size)) ** 2) / 2) + 1e-9
    linear = (weight[:, :, None] * to_linear(colour[known][np.minimum(near, known.sum() - 1)])).sum(axis=1)
    linear /= weight.sum(axis=1, keepdims=True)
    return np.log(np.maximum(linear, BLACK)), away[:, 0] < 2 * AROUND * size


def _unlike_skin(space, fit, target, light, seen):
    """A callable that tells which logarithms of colours (k, 3) are not those of the face's skin; None: too little is seen."""
    face = fit.points[(space.face > 0.5) & (fit.trust > 0.5)]
    if not len(face):
        return None
    on = seen & (cKDTree(face).query(target.vertices, workers=-1)[0] < ON_SKIN * fit.pose.scale)
    if on.sum() < FEWEST:
        return None
    hue, value = _parts(light[on])
    middle, usual = np.median(hue, axis=0), np.median(value)
    own = np.median(np.linalg.norm(hue - middle, axis=1))
    least = max(UNLIKE, AS_GREY * np.linalg.norm(middle), OWN * own)

    def unlike(colours):
        hue, value = _parts(colours)
        return (np.linalg.norm(hue - middle, axis=1) > least) | (value - usual < DARKER)

    return unlike


def _parts(light):
    """Of logarithms of colours (k, 3) the ratios of green and blue to red (k, 2), and how light they are (k,)."""
    return light[:, 1:] - light[:, :1], light @ LUMINANCE


def _may_be(space, fit, points):
    """(k,) bool: which ``points`` (k, 3) mm lie where clothes may be."""
    marks, turn = space.landmarks(fit.points), fit.pose.turn

    def along(place, axis):
        return place @ turn[:, axis] / fit.pose.scale

    ears = (marks["t_l"] + marks["t_r"]) / 2
    behind = along(points, 1) - along(ears, 1)
    most = np.interp(behind, [0.0, BEHIND], [BELOW, NAPE])
    return along(points, 2) - along(marks["gn"], 2) < most


def _cut_off(target, some, low):
    """(n,) bool: the vertices of ``target`` below the jaw, among ``low`` (k,), that no longer hang together with what lies
    above once ``some`` (n,) bool are gone."""
    piece, area = pieces(target, ~some)
    above = ~some
    above[low] = False
    headed = np.zeros(len(area), dtype=bool)
    headed[piece[above]] = True
    return ~some & ~headed[piece]
