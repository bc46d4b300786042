# SPDX-License-Identifier: GPL-3.0-or-later
"""How sure a found landmark is, and which hang in mid-air where the scan shows nothing."""

import numpy as np
from scipy.spatial import cKDTree

from ..adapt.closest import Surface
from ..adapt.completion import sigma
from ..adapt.ears import EAR_MARKS, SOME_MARKS
from ..adapt.scan_surface import cuts_of
from ..mesh import vertex_normals
from ..scan.flat_cuts import beyond
from .shape_fit import Expression, ShapeFit
from .shape_space import ShapeSpace
from .sure import SURE

AROUND = 9.0  # mm: skin about a landmark that must have data
MID_AIR = 3.0  # mm: a landmark farther from the scan hangs in mid-air
LOST = 11.0  # mm: a landmark less certain than that is missing
UNSURE = 8.0  # mm of doubt that halve the confidence
NEAR_EAR = 8.0  # mm from an ear to what the scan has there
LIES = 2.5  # mm from the scan within which skin lies on it
TINY = 1e-9  # mm²: skin that does not count has no area
#: Likeness of a scan to an ear from which on it shows one, see `like_ears`: .47 of ears under hair, from .69 of 22 others.
LIKE_AN_EAR = 0.58
SLIT = 0.5  # opening of lids against the reference's below which open eyes were not read well
UNSEEN = ("tr",)  # no shape tells where hair begins


def doubt(space: ShapeSpace, fit: ShapeFit) -> dict[str, float]:
    """Name -> mm, one standard deviation of each landmark given the data: of the shape and of the landmark's definition."""
    modes = np.einsum("kijm,ki->kjm", space.modes[space.corners], space.weights)
    root = modes @ fit.spread
    shape = fit.pose.scale * np.sqrt((root**2).sum(axis=(1, 2)) / 3)
    return {n: float(np.hypot(shape[k], 0.5 * sigma(n) if n not in UNSEEN else 8.0)) for k, n in enumerate(space.names)}


def support(space: ShapeSpace, fit: ShapeFit) -> dict[str, float]:
    """Name -> 0..1, share of the skin around each landmark that lies on the scan."""
    on = fit.trust * (np.abs(np.nan_to_num(fit.distance, nan=9.0)) < LIES)
    tree = cKDTree(fit.points)
    places = space.landmarks(fit.points)
    near = tree.query_ball_point(np.array(list(places.values())), AROUND * fit.pose.scale)
    area = space.area
    return {
        name: float((area[i] * on[i]).sum() / max(area[i].sum(), TINY)) if len(i) else 0.0
        for name, i in zip(places, near, strict=True)
    }


def judge(space: ShapeSpace, fit: ShapeFit, target: Surface, positions):
    """Confidence {name: 0..1}, names in mid-air (`in_mid_air`), names that are missing."""
    doubts, supports = doubt(space, fit), support(space, fit)
    names = list(positions)
    at = np.array([positions[n] for n in names])
    off = in_mid_air(target, at)
    confidence = {n: (0.3 + 0.7 * min(1.0, 1.6 * supports[n])) / (1 + (doubts[n] / UNSURE) ** 2) for n in names}
    missing = tuple(n for n in names if doubts[n] > LOST and supports[n] < 0.1)
    mid_air = tuple(n for k, n in enumerate(names) if off[k] and n not in missing)
    for n in mid_air:
        confidence[n] *= 0.4
    return confidence, mid_air, missing


def in_mid_air(target: Surface, places) -> np.ndarray:
    """(k,) bool: which ``places`` (k, 3) mm hang where the scan shows nothing. What lies on a flat end, which is no skin, is
    as good as in mid-air."""
    return (target.closest(places).distance > MID_AIR) | beyond(cuts_of(target), places)


def judge_together(positions, confidence, mid_air, rest, shown: Expression, hidden) -> dict[str, float]:
    """Confidence with those lowered that only look sure one by one: on ears under hair, of which few landmarks can be
    seen, on lids that nearly meet although the eye is not ``shown`` shut, and on lids that had to be held open.

    rest : the reference's own landmarks, name -> mm; hidden : the sides of ears that are not seen
    """
    out = dict(confidence)
    for side in ("l", "r"):
        ear = [f"{n}_{side}" for n in EAR_MARKS if f"{n}_{side}" in out]
        marks = sum(out[n] >= SURE and n not in mid_air for n in ear)
        weak = marks < SOME_MARKS or side in hidden
        lids = [f"{n}_{side}" for n in ("ps", "pi", "en", "ex")]
        slit = side not in shown.shut and all(n in positions for n in lids)
        slit = slit and (shown.wide or _opening(positions, lids) < SLIT * _opening(rest, lids))
        for name in (ear if weak else []) + (lids[:2] if slit else []):
            if name in out:
                out[name] = min(out[name], 0.9 * SURE)
    return out


def like_ears(space: ShapeSpace, fit: ShapeFit, target: Surface) -> dict[str, float]:
    """Side -> 0..1, how like an ear the scan is where that ear is laid.

    It is the share that lies on the scan of the ear's skin that finds something there, for hair lies about an ear, times how
    far the scan's normals vary there against the ear's own, for hair is smoother than its folds.
    """
    on = fit.trust * (np.abs(np.nan_to_num(fit.distance, nan=9.0)) < LIES)
    normals = vertex_normals(fit.points, space.triangles)
    out = {}
    for side in "lr":
        ear = np.flatnonzero((space.ear > 0.5) & space.on_side(side) & (fit.trust > 0))
        found = target.closest(fit.points[ear], NEAR_EAR * fit.pose.scale)
        ear, seen = ear[found.found], found.normals[found.found]
        if len(ear) == 0:
            out[side] = 0.0
            continue
        varied = np.sqrt(seen.var(axis=0).sum() / max(normals[ear].var(axis=0).sum(), 1e-9))
        out[side] = float(np.average(on[ear], weights=space.area[ear]) * min(varied, 1.0))
    return out


def sure_as_corners(confidence, name: str) -> float:
    """Confidence in ``name`` (``ps`` or ``pi`` with a side) of lids that are seen, shut or open: they are as sure as the less
    sure of the eye's corners, between which they run."""
    side = name[-1]
    return min(confidence.get(f"en_{side}", 0.0), confidence.get(f"ex_{side}", 0.0))


def _opening(places, lids):
    ps, pi, en, ex = (places[n] for n in lids)
    return np.linalg.norm(ps - pi) / max(np.linalg.norm(en - ex), 1e-9)
