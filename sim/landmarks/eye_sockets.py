# SPDX-License-Identifier: GPL-3.0-or-later
"""Empty sockets, as made heads have them: the outline of the opening tells where the corners of an eye are.

A skin laid on such a head finds nothing where its eyeball's front is, and may come to lie too low or too high by most of an
eye's height; the hole itself is there to be seen.
"""

import numpy as np
from scipy.ndimage import label

from ..adapt.closest import Surface
from ..adapt.eye_frame import eye_frame
from .eye_gaps import SOCKET

ASIDE, ACROSS, STEP = 26.0, 18.0, 0.4  # mm to either side of an eye's middle, above and below it, from place to place
BOTTOM = 60.0  # mm: what lies deeper than this is the other side of an empty shell
#: mm that openings are wide and high, and their share that has the bottom of a socket behind it: scanners leave holes.
WIDE, HIGH, BACKED = (17.0, 42.0), (3.5, 22.0), 0.2
ALIKE = 0.25  # difference of the widths of two openings of one head, against one
#: mm beyond the end of the opening that is seen to where a corner is picked: between, the lids nearly touch.
CORNERS = {"en": (0, -1, 1.0), "ex": (-1, 1, 1.6)}
BESIDE = 2.0  # mm more within which there must be skin


def socket_corners(marks, matrix, target: Surface) -> dict[str, np.ndarray]:
    """Name -> (3,) mm: ``en`` and ``ex`` of both eyes at the ends of the openings of empty sockets; nothing where there are
    none.

    marks : name -> (3,) mm, about where ``en`` and ``ex`` lie; matrix (3, 3) turns and scales the reference into the scan
    """
    out, widths = {}, []
    x, y = np.arange(-ASIDE, ASIDE + STEP / 2, STEP), np.arange(ACROSS, -ACROSS - STEP / 2, -STEP)
    for side in "lr":
        eye = eye_frame(marks, side, matrix)
        places = eye.grid(x, y)
        depth = eye.depth(target, places, BOTTOM * eye.scale)
        opening = opening_in(depth)
        if opening is None:
            return {}
        columns = np.flatnonzero(opening.any(axis=0))
        widths.append(np.ptp(columns))
        for name, (end, way, beyond) in CORNERS.items():
            row = int(np.median(np.flatnonzero(opening[:, columns[end]])))
            on = columns[end] + way * np.arange(round(beyond / STEP), round((beyond + BESIDE) / STEP))
            on = on[(on >= 0) & (on < len(x))]
            skin = np.flatnonzero(np.isfinite(depth[row, on]) & ~opening[row, on])
            if not len(skin):
                return {}
            out[f"{name}_{side}"] = eye.behind(places[row, on[0]], depth[row, on[skin[0]]])
    return out if abs(widths[0] / widths[1] - 1) < ALIKE else {}


def opening_in(depth) -> np.ndarray | None:
    """The opening of a socket (r, c) bool in what is seen of an eye, ``depth`` (r, c) mm every `STEP`; None: there is none."""
    around = depth[depth < SOCKET]
    if not len(around):
        return None
    deep = depth - np.median(around) > SOCKET
    parts, count = label(deep | np.isnan(depth))
    if not count:
        return None
    edge = np.unique(np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]]))
    sizes = np.bincount(parts[deep], minlength=count + 1)
    sizes[edge] = 0  # what falls back beside an eye is the temple
    opening = parts == sizes.argmax()
    rows, columns = (np.flatnonzero(opening.any(axis=axis)) for axis in (1, 0))
    high, wide = (STEP * (np.ptp(at) + 1) for at in (rows, columns))
    fits = WIDE[0] <= wide <= WIDE[1] and HIGH[0] <= high <= HIGH[1]
    return opening if sizes.any() and fits and deep[opening].mean() >= BACKED else None
