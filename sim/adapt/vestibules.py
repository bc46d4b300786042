# SPDX-License-Identifier: GPL-3.0-or-later
"""Nostrils as deep as the scan shows them, or else as noses are.

The reference's nostrils are shallow pockets. A nose's vestibule leads up and back, over the floor of the nose, to the
bony aperture; a scanner sees a little of it or nothing. What it sees bounds the lining, and where it sees nothing the
lining leads back to where the aperture of the skull begins. Many scans span nostrils with a film; they tell nothing.
"""

import numpy as np
from scipy.sparse import diags

from .closest import Surface
from .rest import Rest
from .smooth_system import factorised
from .thin_plate_spline import similarity

#: mm by which the lining leads farther back than the reference's, by edges behind the rim of a nostril: its end then lies
#: in the aperture of the reference's own skull.
BACK = (2.0, 11.0, 14.0)
#: mm by which the wall toward the midline lies nearer to it, likewise: a septum with its lining is some 5 mm thick (our own
#: estimate), that between the reference's pockets 8.
IN = (0.7, 1.5, 0.0)
UP = 3.0  # mm by which it leads farther up, except over the floor
HOLD = (0.2, 1.0, 1.0)  # pull of the lining to its place, likewise, against the energy of bending
DEEPER = 1.5  # times as far within a nostril data is looked for that shows it deeper
FACING = -0.2  # cosine: data that bounds a nostril faces out of it
BEFORE, SPAN = 3.0, 1.0  # mm before and behind the mouth of a nostril within which data spans it
LEAST = 0.3  # of its depth that is left to a nostril at least


def vestibules(rest: Rest, skin: np.ndarray, target: Surface) -> np.ndarray:
    """(n, 3) mm by which the linings of the nostrils lie elsewhere than the skin around them alone would have them.

    rest : the reference; skin (n, 3) mm : its skin as fitted to the scan ``target``
    """
    out = np.zeros_like(skin)
    for rows in rest.nostrils:
        out[rows] = _moved(rest, rows, skin, target)
    return out


def _moved(rest: Rest, rows, skin, target: Surface):
    """(k, 3) mm, for the lining ``rows`` (k,) of one nostril."""
    start, behind = rest.head.skin.vertices, rest.behind[rows]
    rim = _beside(rest, rows)
    ring = np.union1d(rim, _beside(rest, np.union1d(rows, rim)))
    matrix, shift = similarity(start[ring], skin[ring])
    at = start[rows] @ matrix.T + shift
    step = np.clip(behind - 1, 0, len(BACK) - 1)
    place = start[rows].copy()
    place[:, 1] += np.array(BACK)[step]
    hind = (start[rows, 1] - start[rim, 1].mean()) / (np.ptp(start[rim, 1]) / 2)
    aside = np.abs(start[rows, 0])
    low, high = aside[step > 0].min(), aside[step > 0].max()
    place[:, 0] -= np.sign(start[rows, 0]) * np.array(IN)[step] * np.clip((high - aside) / (high - low), 0, 1)
    place[:, 2] += UP * np.clip(1 - hind, 0, 1) * (step > 0)
    place = place @ matrix.T + shift
    place = bounded(target, skin[rim].mean(axis=0), place)
    if place is None:
        return np.zeros_like(at)
    energy = rest.energy[rows]
    carry = -(energy[:, ring] @ (skin[ring] - start[ring] @ matrix.T - shift))
    pull = np.array(HOLD)[step]
    there = factorised(energy[:, rows] + diags(pull))(carry + pull[:, None] * (place - at))
    return there - factorised(energy[:, rows])(carry)


def _beside(rest: Rest, rows):
    """The vertices next to ``rows``."""
    return np.setdiff1d(np.flatnonzero(np.asarray(rest.link[rows].sum(axis=0)).ravel()), rows)


def bounded(target: Surface, mouth: np.ndarray, places: np.ndarray) -> np.ndarray | None:
    """``places`` (k, 3) mm within an opening, moved along the lines from its ``mouth`` (3,) mm to the data seen there.

    Where none is seen they stay. None: the data spans the mouth.
    """
    way = places - mouth
    length = np.linalg.norm(way, axis=1)
    way /= length[:, None]
    line, t, triangle, _ = target.crossings(np.broadcast_to(mouth, way.shape), way, float(DEEPER * length.max()))
    facing = np.einsum("ij,ij->i", target.face_normals[triangle], way[line])
    seen = (facing < FACING) & (t > -BEFORE) & (t < DEEPER * length[line])
    seen &= ~target.border_vertex[target.triangles[triangle]].any(axis=1)
    line, t = line[seen], t[seen]
    if len(np.unique(line[t < SPAN])) > len(places) / 2:
        return None
    at, first = np.unique(line[t >= SPAN], return_index=True)
    share = np.ones(len(places))
    share[at] = np.maximum(t[t >= SPAN][first] / length[at], LEAST)
    return mouth + (share * length)[:, None] * way
