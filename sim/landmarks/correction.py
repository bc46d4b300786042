# SPDX-License-Identifier: GPL-3.0-or-later
"""What a correction of one found landmark says about the others, and which correction would say most."""

import numpy as np
from scipy.spatial.distance import cdist

from ..adapt.completion import RANGE
from ..adapt.thin_plate_spline import ThinPlateSpline

STAY, DOUBT = 40.0, 160.0  # mm of smoothing at a landmark not corrected: a sure one, and what an unsure one has more
LEAST, MOST = 1.0, 12.0  # mm: doubt about a landmark found for certain, and by a guess
BY_HAND = 0.7  # mm: doubt about one that was corrected


def follow_corrections(
    found: dict[str, np.ndarray], confidence: dict[str, float], corrected: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """All landmarks of ``found`` (name -> (3,) mm) after those ``corrected`` were set by hand (Kähler et al. 2002, 6.1).

    The others are warped by the thin-plate spline through those set by hand; each pulls back to where it was found, the
    more the surer it was (confidence, name -> 0..1), so that far away nothing moves.
    """
    names = list(found)
    set_by_hand = [n for n in names if n in corrected]
    if not set_by_hand or len(names) < 5:
        return found | {n: p for n, p in corrected.items() if n in found}
    source = np.array([found[n] for n in names], dtype=float)
    target = np.array([corrected.get(n, found[n]) for n in names], dtype=float)
    give = np.array([0.0 if n in corrected else STAY + DOUBT * (1 - confidence.get(n, 0.0)) for n in names])
    moved = ThinPlateSpline.fit(source, target, give).transform(source)
    return {n: np.array(corrected[n], dtype=float) if n in corrected else moved[k] for k, n in enumerate(names)}


def most_useful(found: dict[str, np.ndarray], confidence: dict[str, float], corrected=()) -> list[str]:
    """Names that are not ``corrected`` yet, the most useful to correct first.

    Errors are taken as a Gaussian field over the head that fades over `completion.RANGE`; the best landmark is the one
    that leaves the least variance in all once it is known (Rasmussen and Williams 2006, equation 2.24).
    """
    names = list(found)
    if not names:
        return []
    at = np.array([found[n] for n in names], dtype=float)
    sure = np.array([confidence.get(n, 0.0) for n in names])
    deviation = LEAST + (MOST - LEAST) * (1 - np.clip(sure, 0, 1))
    covariance = np.outer(deviation, deviation) * np.exp(-cdist(at, at) / RANGE)
    known = [k for k, n in enumerate(names) if n in corrected]
    if known:
        gain = np.linalg.solve(covariance[np.ix_(known, known)] + BY_HAND**2 * np.eye(len(known)), covariance[known])
        covariance = covariance - covariance[:, known] @ gain
    reduction = (covariance**2).sum(axis=1) / (covariance.diagonal() + BY_HAND**2)
    order = np.argsort(-reduction, kind="stable")
    return [names[k] for k in order if names[k] not in corrected]
