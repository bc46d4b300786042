# SPDX-License-Identifier: GPL-3.0-or-later
"""The margins of open lids: two arches from corner to corner of an eye, with holes or creases inside and skin outside.

Where lids end, data end, or an eyeball begins; beyond it lies smooth skin. Of all pairs of arches the one is taken along which
that is plainest on both eyes at once, because eyes are open alike: a hole in a brow or a fold above a lid is on no two sides
what a margin is. (Daugman 2004, *How iris recognition works*, finds lids in pictures by a like difference of sums along arcs.)
"""

import numpy as np

from ..adapt.closest import Surface
from ..adapt.completion import mirror_plane
from ..adapt.eye_frame import eye_frame
from ..adapt.lid_line import BESIDE, DEEPEST, crease
from ..anatomy.landmark_names import mirrored
from .eye_gaps import SOCKET, over_the_eye
from .eyeballs_seen import Eyeball
from .picked import MOVED, moved
from .shape_fit import ShapeFit, Told
from .shape_space import ShapeSpace

SHARES = np.linspace(0.12, 0.88, 39)  # of the way from the inner to the outer corner
TOP, BOTTOM, STEP = 15.0, -12.0, 0.25  # mm above and below the straight way that are looked at, and from place to place
ARCHES = np.arange(-8.0, 13.1, 0.25)  # mm: heights of arches in their middle
BAND = 1.75  # mm inside and outside an arch
USUAL, SPREAD, HEEDED = 9.0, 3.0, 0.25  # mm between open lids, and how much that counts against what is seen
LEAST = 2.5  # mm between lids that are open
PLAIN = 0.8  # of 4: difference between inside and outside of two arches on two eyes from which on they are margins
NEAR = 9.0  # mm before or behind where a lid is taken to lie: what lies farther off is none
MARGIN = {"ps": 0.5, "pi": -0.2}  # mm from the arch to where people pick the margin of the lid


def open_lids(
    marks, matrix, target: Surface, eyeballs: dict[str, Eyeball] | None = None, sides: str = "lr"
) -> dict[str, np.ndarray]:
    """Name -> (3,) mm: ``ps`` and ``pi`` of the eyes on these ``sides``, on the margins of their lids; nothing if these are not
    seen plainly.

    Of a scan whose eyes are known to be open: other creases, on shut lids or of wrinkles, may look alike.

    marks : name -> (3,) mm, about where the eyes' landmarks lie; matrix (3, 3) turns and scales the reference into the scan
    eyeballs : side -> `Eyeball` that the scan shows
    """
    heights = np.arange(TOP, BOTTOM - STEP / 2, -STEP)
    upper, lower, seen = 0.0, 0.0, {}
    for side in sides:
        eye = eye_frame(marks, side, matrix)
        places = eye.lines(SHARES, heights)
        depth = eye.depth(target, places)
        depth[depth - over_the_eye(depth) > SOCKET] = np.nan
        worth = crease(depth, int(BESIDE / STEP)) / DEEPEST
        if eyeballs and side in eyeballs:
            worth[eyeballs[side].shows(eye.behind(places, depth))] = 1.0
        above, below = arches(worth)
        upper, lower, seen[side] = upper + above, lower + below, (eye, places, depth)
    pair = best_pair(upper * (2 / len(sides)), lower * (2 / len(sides)))
    if pair is None:
        return {}
    out = {}
    for side, (eye, places, depth) in seen.items():
        for name, arch in zip(("ps", "pi"), pair, strict=True):
            mark = marks[f"{name}_{side}"]
            picked = eye.share(mark) + MOVED[name][0] * eye.scale / np.linalg.norm(eye.way)
            column = int(np.abs(SHARES - picked).argmin())
            height = arch * bow()[column] + MARGIN[name]
            row = int(np.clip(np.rint((TOP - height) / STEP), 0, len(heights) - 1))
            # The nearest of the lid, and not what lies between the lids.
            lid = depth[column, row::-1] if name == "ps" else depth[column, row:]
            place = eye.behind(places[column, row], lid[np.isfinite(lid).argmax()])
            if not abs((place - mark) @ eye.forward) < NEAR * eye.scale:  # nor is one that nothing is seen of
                return {}
            out[f"{name}_{side}"] = place
    return out


def bow() -> np.ndarray:
    """How high an arch of height 1 is at each of the `SHARES`."""
    return 4 * SHARES * (1 - SHARES)


def arches(worth) -> tuple[np.ndarray, np.ndarray]:
    """How plainly each of the `ARCHES` is the margin of an upper lid, and of a lower one: -1..1.

    worth (c, r) 0..1 : how little a scan shows smooth skin in each of the columns at `SHARES`, from `TOP` to `BOTTOM`
    """
    sums = np.pad(np.cumsum(worth, axis=1), ((0, 0), (1, 0))) * STEP
    columns, last = np.arange(len(worth)), worth.shape[1]

    def above(height):
        at = np.clip((TOP - height) / STEP, 0, last - 1e-6)
        row = at.astype(int)
        return sums[columns, row] + (at - row) * (sums[columns, row + 1] - sums[columns, row])

    arch = ARCHES[:, None] * bow()
    over, under = above(arch) - above(arch + BAND), above(arch - BAND) - above(arch)
    difference = (under - over).mean(axis=1) / BAND
    return difference, -difference


def best_pair(upper, lower) -> tuple[float, float] | None:
    """Heights mm of the upper and the lower of two `ARCHES` that are the plainest margins, how plainly each being summed over
    both eyes in ``upper`` and ``lower``; None: none are plain."""
    seen = upper[:, None] + lower
    size = ARCHES[:, None] - ARCHES
    liked = np.where(size < LEAST, -np.inf, seen - HEEDED * ((size - USUAL) / SPREAD) ** 2)
    above, below = np.unravel_index(liked.argmax(), liked.shape)
    return (float(ARCHES[above]), float(ARCHES[below])) if seen[above, below] > PLAIN else None


def of_both_eyes(lids: dict[str, np.ndarray], marks: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """``lids``, name -> (3,) mm, and, where they are those of one eye only, their images on the other side of the face: an eye
    that no scan shows is as wide open as the other one.

    marks : name -> (3,) mm, about where all landmarks lie
    """
    if len({name[-1] for name in lids}) != 1:
        return lids
    middle, across = mirror_plane(marks)
    return lids | {mirrored(name): place - 2 * (place - middle) @ across * across for name, place in lids.items()}


def told_of_open_lids(space: ShapeSpace, fit: ShapeFit, seen: dict[str, np.ndarray]) -> Told:
    """What margins of lids that are ``seen``, name -> (3,) mm as people pick them, tell of the skin of ``fit``."""
    return Told.of(space, {name: place - fit.matrix @ moved(name) for name, place in seen.items()})
