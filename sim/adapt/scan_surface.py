# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of a scan that is looked at: all of an ordinary one, of a large one the head, no finer than its maps show."""

import numpy as np

from ..anatomy.head import Head
from ..errors import InputError
from ..mesh import Mesh
from ..scan.depth_jumps import depth_jumps
from ..scan.flat_cuts import beyond, flat_cuts
from ..scan.units import PLAUSIBLE
from .closest import Surface
from .thin_plate_spline import similarity

NORMALS = 2.0  # mm over which the scan's normals are averaged
MOST = 600_000  # triangles of a scan that are all looked at: edges of about 0.7 mm on a head
FEWEST = 300  # triangles of a smaller one, of somebody from head to foot, that are a head
ROOM = 0.35  # of the head's size that is kept around it
#: What of a scan may be no skin: what a depth map has stretched over its jumps, where it was cut off, what the lips hold,
#: hair, glasses, a beard, clothes about the neck.
NO_SKIN = ("depth_jumps", "flat_ends", "held_by_lips", "hair", "glasses", "beard", "clothing")


def to_leave_out(choice: str) -> frozenset[str]:
    """What of `NO_SKIN` a ``choice`` leaves out: all (``auto``), nothing (``never``), or what it names, commas between.

    Raises
    ------
    InputError : the choice names something else.
    """
    if choice in ("auto", "never"):
        return frozenset(NO_SKIN if choice == "auto" else ())
    named = [name.strip() for name in choice.split(",")]
    for name in named:
        if name not in NO_SKIN:
            some = f"{', '.join(NO_SKIN[:-1])} and {NO_SKIN[-1]}"
            raise InputError(f"To leave out {name!r} is unknown: choose auto, never, or of {some}, commas between.")
    return frozenset(named)


def scan_surface(reference: Head, scan: Mesh, given: dict[str, np.ndarray], most: int = MOST) -> Surface:
    """The surface of ``scan`` (mm, any place) that the reference is fitted to: `near_head` without jumps and cuts."""
    return without_cuts(without_jumps(near_head(reference, scan, given, most)))


def near_head(reference: Head, scan: Mesh, given: dict[str, np.ndarray], most: int = MOST) -> Surface:
    """The surface of ``scan`` (mm, any place) that is looked at.

    given : name -> (3,) mm, landmarks that tell where the head is. A scan of more than ``most`` triangles, or of more than a
    bust, is cut to the head's neighbourhood, unless the landmarks lie elsewhere, and thinned (`Surface.coarser`).
    """
    triangles = scan.triangles
    large = len(triangles) > most
    if not large and np.ptp(scan.vertices, axis=0).max() <= PLAUSIBLE[1]:
        return Surface(scan.vertices, triangles, NORMALS)
    rest = reference.landmark_positions()
    names = [name for name in given if name in rest]
    matrix, shift = similarity([rest[name] for name in names], [given[name] for name in names])
    head = reference.skin.vertices @ matrix.T + shift
    margin = ROOM * np.ptp(head, axis=0).max()
    near = ((scan.vertices > head.min(axis=0) - margin) & (scan.vertices < head.max(axis=0) + margin)).all(axis=1)
    kept = near[triangles].all(axis=1)
    some = triangles[kept] if kept.sum() > (most / 10 if large else FEWEST) else triangles
    return Surface(scan.vertices, some, NORMALS).coarser(most)


def without_cuts(surface: Surface) -> Surface:
    """``surface`` without its flat ends (`flat_cuts`): there it stops, and what lies beyond is to be invented."""
    return surface.without(beyond(cuts_of(surface), surface.vertices)[surface.triangles].any(axis=1))


def without_jumps(surface: Surface) -> Surface:
    """``surface`` without what a depth map has stretched over its jumps (`depth_jumps`)."""
    return surface.without(depth_jumps(surface.vertices, surface.triangles))


def cuts_of(surface: Surface) -> np.ndarray:
    """(k, 4) planes of its flat ends, see `flat_cuts`."""
    return flat_cuts(surface.vertices, surface.triangles, surface.face_normals, surface.area)
