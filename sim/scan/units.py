# SPDX-License-Identifier: GPL-3.0-or-later
"""In which unit a scan is measured: one of the usual, one that is told, or none at all.

Photogrammetry without a scale bar, sculpts and statues have any size, and only the face in them tells which is a person's.
"""

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.spatial import cKDTree

from ..errors import InputError
from ..mesh import Mesh
from .face_match import surface_samples

#: Unit -> mm.
UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
USUAL = tuple(UNITS.values())

#: Largest extent of a scan of a face patch (the smallest) and of a bust (the largest), mm.
PLAUSIBLE = (90.0, 900.0)
BODY = 2600.0  # mm, the same of somebody from head to foot: taken for that only if no unit makes a head of it
SCENE = 15_000.0  # mm, the same of somebody in a room
POSSIBLE = (10.0, 1e5)  # mm, the same of whatever may hold a head, where somebody tells the unit

#: What a unit is called that the size of the face tells, because no usual one makes it a person's.
BY_FACE = "face"
CUSTOM = "custom"  # what one is called that is given as a number
#: mm, the median of their distances, by which landmarks lie beside a scan that is in another unit than is thought. Those that
#: are picked or found lie 0.5 to 3 mm from samples of its surface.
BESIDE = 5.0
SIZES = 100  # of a scan that are tried to find that of its landmarks

#: mm across: the least and the most that a scan of a face, a head or somebody from head to foot may be.
LEAST, MOST = 120.0, 2600.0
STEP = 1.5  # from one size tried to the next: a face is found if it is 0.72 to 1.22 of the reference (`face_match`)
#: Heads of people, of the reference's size: a newborn's (head circumference 31.5 cm, 2 standard deviations below the mean of
#: girls, WHO 2007) and a large man's (62 cm, above the 99th percentile in ANSUR, Gordon et al. 1989). The reference's is 54.5
#: cm, and the size of a fit may be off by 8 %.
SMALLEST, LARGEST = 0.53, 1.22
GROWN = 0.7  # the smallest head with the face of a grown person


def sizes_to_try(points: np.ndarray) -> list[float]:
    """mm per unit of samples (n, 3) of a scan: so many that a face in it is near its size in one of them."""
    extent = float(np.ptp(points, axis=0).max())
    return [float(size) / extent for size in LEAST * STEP ** np.arange(1 + np.log(MOST / LEAST) // np.log(STEP))]


def is_human(size: float, smallest: float = GROWN) -> bool:
    """Whether a head of ``size``, relative to the reference's, is a person's; ``smallest`` : the least that may be."""
    return smallest < size < LARGEST


def is_body(extent: float) -> bool:
    """Whether a scan with this largest ``extent`` in mm is of more than a bust, and of no more than somebody."""
    return PLAUSIBLE[1] < extent <= BODY


def is_scene(extent: float) -> bool:
    """Whether a scan with this largest ``extent`` in mm is of more than a bust, and of no more than somebody in a room."""
    return PLAUSIBLE[1] < extent <= SCENE


def plausible_units(mesh: Mesh, unit: str | float | None = None) -> dict[str, float]:
    """Unit -> mm, of those in which the scan is as large as a head, perhaps none; only ``unit`` where it is given.

    Raises
    ------
    InputError : ``unit`` is not understood, or makes the scan something that no head can be in.
    """
    return dict(units_of(surface_samples(mesh), unit))


def units_of(points: np.ndarray, unit, called: str = CUSTOM) -> list[tuple[str, float]]:
    """(name, mm) of `plausible_units` for samples (n, 3) of a scan; ``called`` : the name of one that is given as a number.

    Raises
    ------
    InputError : ``unit`` is not understood, or makes the scan something that no head can be in.
    """
    extent = np.ptp(points, axis=0).max()
    if unit is not None:
        name, scale = told_unit(unit, called)
        if not POSSIBLE[0] < extent * scale < POSSIBLE[1]:
            raise InputError(
                f"In {unit_words(name, scale)} the scan is {extent * scale:.3g} mm across, which is no head: give another "
                "unit, or none to have it detected."
            )
        return [(name, scale)]
    least, most = PLAUSIBLE
    units = [(name, scale) for name, scale in UNITS.items() if least <= extent * scale <= most]
    return units or [(name, scale) for name, scale in UNITS.items() if is_body(extent * scale)]


def larger_units(points: np.ndarray) -> list[tuple[str, float]]:
    """(name, mm) of the usual units in which samples (n, 3) of a scan are more than a bust, as somebody in a room."""
    extent = np.ptp(points, axis=0).max()
    return [(name, scale) for name, scale in UNITS.items() if is_scene(extent * scale)]


def told_unit(unit: str | float, called: str = CUSTOM) -> tuple[str, float]:
    """(name, mm) of a unit that somebody gives, by its name or in mm; ``called`` : its name in the second case.

    Raises
    ------
    InputError : it is neither.
    """
    name = str(unit).strip().lower()
    if name in UNITS:
        return name, UNITS[name]
    try:
        scale = float(unit)
    except ValueError:
        scale = float("nan")
    if not 0 < scale < float("inf"):
        raise InputError(f"{unit!r} is no unit: give mm, cm, m, in, or millimetres per unit as a number.")
    return called, scale


def no_head(points: np.ndarray) -> InputError:
    """What to raise if a scan, of which ``points`` (n, 3) are samples, is none in any unit."""
    extent = np.ptp(points, axis=0).max()
    return InputError(
        f"The scan is {extent:.4g} units across, which is no head in mm, cm, m or inches, and no face shows its size: give the "
        "unit, as a name or as millimetres per unit."
    )


def unit_words(name: str, scale: float) -> str:
    """What a unit of ``scale`` mm is called where it is shown to people."""
    words = {"mm": "millimetres", "cm": "centimetres", "m": "metres", "in": "inches"}
    said = words.get(name, f"units of {scale:.4g} mm")
    return said + ", a guess that makes the head as large as most" * (name == BY_FACE)


def unit_of_landmarks(points: np.ndarray, landmarks: dict[str, np.ndarray], units, told: bool) -> tuple[str, float]:
    """(name, mm) of the one of ``units`` (`units_of`) in which ``landmarks`` (mm) lie nearest to a scan's samples (n, 3); where
    they lie beside it in all of them and none is ``told``, the one that they tell.

    Raises
    ------
    InputError : there is none.
    """
    marks = np.array([p for p in landmarks.values() if np.isfinite(p).all()], dtype=float)
    tree = cKDTree(points)

    def away(scale):
        return scale * float(np.median(tree.query(marks / scale)[0]))

    distance, (name, scale) = min(((away(unit[1]), unit) for unit in units), default=(np.inf, (None, None)))
    if distance > BESIDE and not told:
        sizes = np.geomspace(LEAST, MOST, SIZES) / np.ptp(points, axis=0).max()
        best = int(np.argmin([away(size) for size in sizes]))
        least, most = sizes[max(best - 1, 0)], sizes[min(best + 1, SIZES - 1)]
        nearest = minimize_scalar(away, bounds=(least, most), method="bounded", options={"xatol": 1e-4 * least})
        if nearest.fun < min(BESIDE, 0.5 * distance):
            return CUSTOM, float(nearest.x)
    if name is None:
        raise no_head(points)
    return name, scale
