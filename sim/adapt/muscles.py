# SPDX-License-Identifier: GPL-3.0-or-later
"""Muscles under a fitted skin: warped with the space between skin and bone, then kept in it (Kähler 2002, 5.2, item 3)."""

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix, diags

from ..anatomy.head import Muscle
from ..anatomy.inside import inside
from ..anatomy.muscle_bounds import easing
from ..anatomy.muscle_room import Room
from ..anatomy.muscle_shape import reshaping
from ..mesh import edges
from ..progress import Progress, Work, portion
from .bone import depth_under
from .closest import Surface
from .rest import BONES, Rest

CLEAR = 0.15  # mm a fibre keeps from the walls of its room, at least
UNDER = 0.1  # mm under skin and lining to which a belly that came out of them is drawn back
LOST = 3.0  # mm: nothing comes out farther


def carried_muscles(rest: Rest, parts, eyes, warp) -> Work:
    """Work returning the reference's muscles sent through ``warp`` (`Rest.between`) and kept between skin and bone.

    parts : name -> (n, 3) mm of skin and bones as they are now; eyes : the two `Eye`
    """
    yield Progress(0.0, "Muscles")
    muscles, skin = rest.head.muscles, rest.head.skin.moved(parts["skin"])
    bones = [rest.head.parts[name].moved(parts[name]) for name in BONES]
    room = Room(skin, bones, rest.inner, [(eye.centre, eye.radius) for eye in eyes], mirrored=False)
    cuts = np.cumsum([m.fibres.size // 3 for m in muscles])[:-1]
    points = warp.transform(np.concatenate([m.fibres.reshape(-1, 3) for m in muscles]))
    fibres = [f.reshape(m.fibres.shape) for f, m in zip(np.split(points, cuts), muscles, strict=True)]
    keep, clear = [np.ones(f.shape[:2]) for f in fibres], [np.full(f.shape[:2], CLEAR) for f in fibres]
    rings = [m.ring for m in muscles]
    fibres = yield from portion(easing(fibres, keep, clear, rings, room, rounds=5, beside=0.25), 0.05, 0.35)
    centres = [None if m.centre is None else warp.transform(m.centre[None])[0] for m in muscles]
    bellies = yield from portion(reshaping(muscles, fibres, room, centres), 0.35, 0.8)
    return (yield from portion(drawn_in(tuple(bellies), skin), 0.8, 1.0))


def drawn_in(muscles: tuple[Muscle, ...], skin, rounds: int = 6) -> Work:
    """Work returning ``muscles`` with the last of their bellies drawn back under the skin and its linings (``skin``, a mesh).

    At the bottom of the narrow slits between lips and gums no normal tells inside from outside; the winding number does.
    What is out takes its neighbours along.
    """
    surface = Surface(skin.vertices, skin.triangles)
    at = np.concatenate([m.shape.vertices for m in muscles])
    cuts = np.cumsum([len(m.shape.vertices) for m in muscles])
    first = np.concatenate([[0], cuts[:-1]])
    pairs = np.concatenate([edges(m.shape.faces) + start for m, start in zip(muscles, first, strict=True)])
    link = coo_matrix((np.ones(2 * len(pairs)), (pairs.ravel("F"), pairs[:, ::-1].ravel("F"))), shape=(len(at),) * 2)
    link = link.tocsr()
    mean = diags(1 / np.maximum(np.asarray(link.sum(axis=1)).ravel(), 1)) @ link
    ask = np.arange(len(at))
    for turn in range(rounds):
        yield Progress(turn / rounds, "Muscles")
        depth, found = depth_under(at[ask], surface, LOST)
        out = np.flatnonzero(depth < 0)
        out = out[~inside(at[ask[out]], skin.vertices, skin.triangles)]
        rows = ask[out]
        if len(rows) == 0:
            break
        gap = found.points[out] - at[rows]
        way = gap / np.maximum(np.linalg.norm(gap, axis=1, keepdims=True), 1e-9)
        push = np.zeros_like(at)
        push[rows] = gap + UNDER * way
        spread = push
        for _ in range(2):
            spread = mean @ spread
            spread[rows] = push[rows]
        at = at + spread
        ask = np.flatnonzero(np.abs(spread).max(axis=1) > 1e-4)
    return tuple(
        replace(m, shape=m.shape.moved(vertices)) for m, vertices in zip(muscles, np.split(at, cuts[:-1]), strict=True)
    )
