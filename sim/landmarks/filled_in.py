# SPDX-License-Identifier: GPL-3.0-or-later
"""A scan with the skin that things hide on it, and that it lacks, in its place: behind what lips hold, glasses, beards, fringes
and hair, below a scan that ends at the mouth, and where there is nothing."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from ..adapt.closest import Surface
from .beards import OVER_SKIN, picked_on
from .confidence import in_mid_air
from .glasses import BEFORE_SKIN
from .hidden_skin import COVERED, TOLD, UNSEEN, hidden_skin, unseen_face, unseen_scalp, with_hidden_skin
from .laid_head import LaidHead
from .picked import moved
from .skin_left import SkinLeft
from .under_hair import EAR, scalp_by_face
from .unseen_jaw import unseen_jaw


@dataclass(frozen=True, eq=False)
class FilledIn:
    """surface : what is left of a scan, with skin in its place; hidden (n,) bool : the points of the skin that make that up;
    misled : names of landmarks that were picked on a beard or a fringe."""

    surface: Surface
    hidden: np.ndarray
    misled: set[str]


def filled_in(
    head: LaidHead,
    left: SkinLeft,
    given: dict[str, np.ndarray],
    telling: Collection[str],
    found: Collection[str],
    leave_out: Collection[str],
) -> FilledIn:
    """What is ``left`` of a scan on which a ``head`` is laid, filled in.

    given : name -> (3,) mm, landmarks of the reference's; telling : names of those that tell where skin is; found : names of
    those that nobody picked; leave_out : of `NO_SKIN`
    """
    space, fit, hair = head.space, head.fit, head.hair
    marks = {n: given[n] for n in telling}
    under = hidden_skin(space, fit, _corners(head.beard), left.surface, OVER_SKIN)
    hidden = _hidden_in_face(head, left, np.reshape([p for n, p in given.items() if n not in found], (-1, 3)))
    filled = with_hidden_skin(space, fit, hidden & ~under, left.surface)
    filled, misled = _below_beard(head, under, filled, marks, found)
    hidden |= under
    if len(head.fringe.triangles):
        forehead = hidden_skin(space, hair.scalp, head.fringe.vertices, left.surface, OVER_SKIN)
        forehead &= head.fringed & _no_ear(space)
        filled = with_hidden_skin(space, hair.scalp, forehead, filled)
        hidden |= forehead
        below = _named(space, head.fringed, np.any)
        misled |= picked_on(space, hair.scalp, head.fringe, {n: p for n, p in given.items() if n in below})
    scalp = scalp_by_face(space, hair, left.covered, given)
    filled = with_hidden_skin(space, scalp, left.covered & _no_ear(space), filled)
    unseen = unseen_scalp(space, hair.scalp, left.surface) & ~left.covered
    if "hair" not in leave_out and hair.covered.any():  # what lies far below hair is not unseen
        unseen[:] = False
    filled = with_hidden_skin(space, hair.scalp, unseen & _no_ear(space), filled, UNSEEN)
    return FilledIn(filled, hidden | left.covered | unseen, misled)


def _hidden_in_face(head, left, picks):
    """(n,) bool: the points of the skin behind what the lips hold and glasses, and those that the scan lacks but not the places
    ``picks`` (k, 3) mm."""
    space, fit = head.space, head.fit
    hidden = hidden_skin(space, fit, left.held, left.surface)
    hidden |= hidden_skin(space, fit, _corners(head.glasses), left.surface, BEFORE_SKIN)
    if head.ends_at_jaw:
        hidden |= unseen_jaw(space, fit, left.surface)
    return hidden | unseen_face(space, fit, left.surface, picks[in_mid_air(left.surface, picks)])


def _below_beard(head, under, filled, marks, found):
    """The scan ``filled`` with the skin ``under`` (n,) bool a beard, and the names of ``marks`` that were picked on that."""
    space, fit, below = head.space, head.fit, _named(head.space, under, np.all)
    marks = {n: p for n, p in marks.items() if n in below}
    misled = picked_on(space, fit, head.beard, marks) if len(head.beard.triangles) else set()
    chin = {n: p - fit.matrix @ moved(n) for n, p in marks.items() if n not in (*found, *misled)}
    return with_hidden_skin(space, fit, under, filled, TOLD if chin else COVERED, chin), misled


def _named(space, there, how):
    """Names of the landmarks of which all corners, or any (``how``), are among the points ``there`` (n,) bool."""
    return {name for name, corners in zip(space.names, space.corners, strict=True) if how(there[corners])}


def _corners(thing):
    return thing.vertices[thing.triangles.ravel()]


def _no_ear(space):
    return space.ear < EAR  # ears take the reference's shape
