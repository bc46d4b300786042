# SPDX-License-Identifier: GPL-3.0-or-later
"""The gate: landmarks and scan that cannot belong together are refused, with the reason and the remedy."""

from collections.abc import Collection

import numpy as np

from ..anatomy.head import Head
from ..anatomy.landmark_names import label, mirrored
from ..errors import InputError
from ..mesh import Mesh
from .arrangement import Faces, Likeness
from .closest import Surface
from .relief import face_likeness

AWAY = 30.0  # mm: median distance from landmarks to scan above which they are not of one head
BESIDE = (
    2.5,
    1.6,
    4.0,
)  # mm: a median above the first, or above the second with a quarter above the third, is another's
#: mm: medians above which landmarks are another's, from the scan's surface and from where a face laid on the scan has them. Of
#: 18 people their own lie up to 0.2 and 3.7 off, with errors of picking in all directions 1.7 and 4.3; of two scanned people in
#: one place the other's 1.8 and 6.2, 2.0 and 5.7.
ANOTHERS = (1.2, 5.0)
ENOUGH = 8  # landmarks of the face over data that tell so
ODD = 12.0  # mm: a single landmark that far from where all others expect it, and
STRANGE = 6.5  # standard deviations of that expectation, is a mistake
UNLIKE = 3.5  # variance of the whole arrangement relative to people's, above which it is no face
GAIN = 12.0  # squared standard deviations that an exchange of names must save to count as a mistake
SCALE = (0.45, 1.6)  # head size relative to the reference
#: Landmarks whose places in a face are plain to see.
TELLING = "g n se prn sn sl pg gn ls li sto en ex ps pi al ac sbal ch cph".split()
#: mm: a picked landmark farther from where a face laid on the scan has it is doubted, by its name. Of 15 scans their own lie
#: up to 8.4 off, but for a chin that was moved 12 mm aside, 10.8; parted lips have two middles.
DOUBTED = dict.fromkeys("prn sn ls li en ex ps pi al ac sbal ch cph".split(), 10.0) | dict.fromkeys(
    "g n se sl pg gn t".split(), 14.0
)
#: What is said of landmarks that nobody picked.
NO_LIKELY_FACE = (
    "What was found in the scan is no likely face, as {}: check that the scan shows a whole face, or give landmarks with "
    "--landmarks or by clicking them."
)
RELIEF = 0.65  # correlation of relief with the reference's; faces have 0.78 and more, a ball and an egg 0.6 and less


def check_against_scan(landmarks: dict[str, np.ndarray], scan: Mesh | Surface) -> None:
    """Refuse landmarks that do not lie on, or near, the scan (mm both).

    Landmarks may hang in mid-air over holes, so it is their median distance that counts.

    Raises
    ------
    InputError : other units, or another place, than the scan.
    """
    points = np.array(list(landmarks.values()), dtype=float)
    surface = scan if isinstance(scan, Surface) else Surface(scan.vertices, scan.triangles)
    size = np.linalg.norm(np.ptp(points, axis=0))
    scan_size = np.linalg.norm(np.ptp(surface.vertices, axis=0))
    # A face's landmarks span a quarter to all of the scan; the factor that makes it so names the unit.
    units = ((1000.0, "metres"), (10.0, "centimetres"), (25.4, "inches"))
    if size < 0.12 * scan_size:
        away, factor, unit = min((np.median(surface.closest(points * f).distance), f, unit) for f, unit in units)
        if away < AWAY:
            raise InputError(
                f"The landmarks span {size:.3g} mm and the scan {scan_size:.0f} mm, as if the landmarks were in "
                f"{unit}, or the scan's unit {factor:g} times as long as it is: multiply the landmarks by {factor:g}, or "
                "correct the unit (--units)."
            )
    if size > 3 * scan_size:
        away, factor, unit = min((f * np.median(surface.closest(points / f).distance), f, unit) for f, unit in units)
        if away < AWAY:
            raise InputError(
                f"The landmarks span {size:.0f} mm and the scan {scan_size:.3g} mm, as if the scan were in {unit}: give "
                f"the scan's unit, or multiply the scan by {factor:g}."
            )
    if size < 0.02 * scan_size or size > 20 * scan_size:
        raise InputError(
            f"The landmarks span {size:.3g} mm and the scan {scan_size:.3g} mm: give both in the same units."
        )
    distance = np.median(surface.closest(points).distance)
    if distance > AWAY:
        raise InputError(
            f"Half of the landmarks lie more than {distance:.0f} mm from the scan: give landmarks picked on this scan, "
            "in its own place, axes and units."
        )


def check_on_surface(landmarks: dict[str, np.ndarray], scan: Surface) -> None:
    """Refuse landmarks that float above or sink below the scan (mm both): they are another head's.

    Over a hole or beside an open side a landmark may hang in mid-air; those do not count.

    Raises
    ------
    InputError : the landmarks lie beside the surface.
    """
    near = scan.closest(np.array(list(landmarks.values()), dtype=float))
    over = near.distance[~near.border]
    if len(over) < 4:
        return
    middle, upper = np.percentile(over, (50, 75))
    if middle > BESIDE[0] or (middle > BESIDE[1] and upper > BESIDE[2]):
        raise InputError(
            f"A quarter of the landmarks lie {upper:.0f} mm or more beside the scan's surface, as if they were another "
            "head's: give landmarks picked on this scan."
        )


def check_on_face(landmarks: dict[str, np.ndarray], laid: dict[str, np.ndarray], scan: Surface) -> None:
    """Refuse landmarks that lie beside the scan's surface and elsewhere than ``laid``, where a face laid on the scan has them
    (mm all): they are another head's in the same place.

    Raises
    ------
    InputError : the landmarks are another's.
    """
    names = [n for n in landmarks if n in laid and n.partition("_")[0] in TELLING]
    given = np.reshape([landmarks[n] for n in names], (-1, 3))
    near = scan.closest(given)
    over = ~near.border
    if over.sum() < ENOUGH:
        return
    beside = np.median(near.distance[over])
    off = np.median(np.linalg.norm(given - np.reshape([laid[n] for n in names], (-1, 3)), axis=1)[over])
    if beside > ANOTHERS[0] and off > ANOTHERS[1]:
        raise InputError(
            f"Half of the landmarks lie {off:.0f} mm or more from where the face in the scan has them, as if they were another "
            "head's: give landmarks picked on this scan."
        )


def doubted(picked: dict[str, np.ndarray], laid: dict[str, np.ndarray]) -> dict[str, float]:
    """Of landmarks that somebody ``picked`` those far from where a face ``laid`` on the scan has them (name -> (3,) mm both):
    name -> how far, mm, the farthest first."""
    off = {n: float(np.linalg.norm(np.asarray(p) - laid[n])) for n, p in picked.items() if n in laid}
    far = {n: away for n, away in off.items() if away > DOUBTED.get(n.partition("_")[0], np.inf)}
    return dict(sorted(far.items(), key=lambda item: -item[1]))


def check_arrangement(
    reference: dict[str, np.ndarray], given: dict[str, np.ndarray], found: Collection[str] = ()
) -> None:
    """Refuse landmarks that do not form a human face: sides exchanged, one misplaced, another scale or no face at all.

    ``reference`` holds the reference head's landmarks (mm), ``given`` the scan's; ``found``, names of those that nobody picked.

    Raises
    ------
    InputError : with the landmark to look at, where one can be named.
    """
    names = [n for n in given if n in reference]
    if len(names) < 4:
        return
    faces = Faces(reference, names)
    places = np.array([given[n] for n in names], dtype=float)
    likeness = faces.likeness(places)
    _refuse_exchanged(faces, places, likeness)
    unpicked = bool(found) and set(names) <= set(found)
    worst = int(np.argmax(likeness.strange))
    said = f'"{names[worst]}" ({label(names[worst])})'
    away = float(np.linalg.norm(likeness.off[worst])) * likeness.scale
    if len(names) > 5 and likeness.strange[worst] > STRANGE and away > ODD:
        said += f" lies {away:.0f} mm from where the others expect it"
        raise InputError(
            NO_LIKELY_FACE.format(said) if unpicked else f"The landmark {said}: place it again or leave it out."
        )
    if likeness.energy > UNLIKE * 3 * len(names):
        raise InputError(
            NO_LIKELY_FACE.format(f"{said} and others lie where no face has them")
            if unpicked
            else f"The landmarks do not form a face (the least likely is {said}): check their names and places against "
            "the scan."
        )
    if not SCALE[0] < likeness.scale < SCALE[1]:
        raise InputError(
            f"The landmarks make a head {likeness.scale:.2g} times the size of an adult's: check the units of scan and "
            "landmarks."
        )


def _refuse_exchanged(faces: Faces, places: np.ndarray, found: Likeness) -> None:
    """Refuse landmarks that form a far likelier face with names exchanged: all sides, some pairs, or two that stand
    out."""
    names = faces.names
    order = np.array([names.index(mirrored(n)) if mirrored(n) in names else k for k, n in enumerate(names)])
    pairs = [(k, int(j)) for k, j in enumerate(order) if names[k].endswith("_l") and j != k]
    if not pairs and faces.likeness(places * [-1.0, 1.0, 1.0]).energy < found.energy - 4 * GAIN:
        raise InputError("The landmarks are those of a mirrored face: mirror the scan, or exchange _l and _r.")
    enough = min(0.5 * found.energy, found.energy - GAIN, UNLIKE * 3 * len(names))
    if pairs and faces.likeness(places[order]).energy < enough:
        raise InputError(
            "The landmarks' left and right are exchanged: _l is the subject's own left, so swap the names, or mirror "
            "the scan if it is mirrored."
        )
    odd = [int(k) for k in np.argsort(-found.strange)[:4]]
    trials = pairs + [(i, j) for i in odd for j in odd if i < j and (i, j) not in pairs and (j, i) not in pairs]
    places, energy, exchanged = places.copy(), found.energy, []
    while trials:
        costs = []
        for i, j in trials:
            other = places.copy()
            other[[i, j]] = other[[j, i]]
            costs.append(faces.likeness(other).energy)
        best = int(np.argmin(costs))
        if costs[best] > energy - GAIN or costs[best] > 0.9 * energy:
            break
        i, j = trials.pop(best)
        places[[i, j]] = places[[j, i]]
        energy = costs[best]
        exchanged.append(f'"{names[i]}" and "{names[j]}"')
    if exchanged and energy < UNLIKE * 3 * len(names):
        said = exchanged[0] if len(exchanged) == 1 else ", ".join(exchanged[:-1]) + " and also " + exchanged[-1]
        where = "their places" if len(exchanged) == 1 else "the places of each pair"
        raise InputError(f"The landmarks {said} are exchanged: swap {where}.")


def check_likeness(reference: Head, vertices: np.ndarray, fitted: np.ndarray) -> None:
    """Refuse a fitted skin (n, 3) without the relief of a face: the scan shows something else where the landmarks are.

    fitted (n,) 0..1 : how far the scan decided

    Raises
    ------
    InputError : no nose, sockets and lips in the scan.
    """
    if face_likeness(reference, vertices, fitted) < RELIEF:
        raise InputError(
            "The scan shows no face where the landmarks say it is: check that landmarks and scan belong together, or "
            "choose the scan of a face."
        )
