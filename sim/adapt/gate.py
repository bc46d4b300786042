# SPDX-License-Identifier: GPL-3.0-or-later
"""The gate: landmarks and scan that cannot belong together are refused, with the reason and the remedy."""

import numpy as np

from ..anatomy.landmark_names import label, mirrored
from ..errors import InputError
from ..mesh import Mesh
from .closest import Surface
from .thin_plate_spline import similarity

AWAY = 30.0  # mm: median distance from landmarks to scan above which they are not of one head
ODD = 30.0  # mm on an adult head: a single landmark that far from where a face has it is a mistake
UNLIKE = 14.0  # mm on an adult head: root mean square distance from any human arrangement
SCALE = (0.45, 1.6)  # head size relative to the reference


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
    for factor, unit in ((1000.0, "metres"), (10.0, "centimetres"), (25.4, "inches")):
        # A face's landmarks span a quarter to all of the scan; the factor that makes it so names the unit.
        if size * factor < 1.6 * scan_size and size < 0.06 * scan_size:
            scaled = surface.closest(points * factor).distance
            if np.median(scaled) < min(AWAY, np.median(surface.closest(points).distance)):
                raise InputError(
                    f"The landmarks span {size:.3g} mm and the scan {scan_size:.0f} mm, as if the landmarks were in "
                    f"{unit}: multiply them by {factor:g}."
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


def check_arrangement(reference: dict[str, np.ndarray], given: dict[str, np.ndarray]) -> None:
    """Refuse landmarks that do not form a human face: sides exchanged, one misplaced, another scale or no face at all.

    ``reference`` holds the reference head's landmarks (mm), ``given`` the scan's.

    Raises
    ------
    InputError : with the landmark to look at, where one can be named.
    """
    names = [n for n in given if n in reference]
    if len(names) < 4:
        return
    p = np.array([reference[n] for n in names], dtype=float)
    q = np.array([given[n] for n in names], dtype=float)

    def misfit(target, mirror=False, weights=None):
        a, t = similarity(p, target, weights, mirror=mirror)
        scale = abs(np.linalg.det(a)) ** (1 / 3)
        return np.linalg.norm(target - p @ a.T - t, axis=1) / max(scale, 1e-9), scale

    residual, scale = misfit(q)
    rms = _rms(residual)
    if any(n.endswith("_l") and mirrored(n) in names for n in names):
        swapped = np.array([given.get(mirrored(n), given[n]) for n in names], dtype=float)
        turned = _rms(misfit(swapped)[0])
        # All sides exchanged is a mirrored face: it fits with the sides put right.
        if rms > 8.0 and turned < 0.5 * rms and turned < UNLIKE:
            raise InputError(
                "The landmarks' left and right are exchanged: _l is the subject's own left, so swap the names, or "
                "mirror the scan if it is mirrored."
            )
        for k, name in enumerate(names):
            other = mirrored(name)
            if name.endswith("_l") and other in names and rms > 3.0:
                trial = q.copy()
                j = names.index(other)
                trial[[k, j]] = q[[j, k]]
                if _rms(misfit(trial)[0]) < 0.6 * rms:
                    raise InputError(f'The landmarks "{name}" and "{other}" are exchanged: swap their places.')
    elif rms > 8.0 and _rms(misfit(q, mirror=True)[0]) < 0.5 * rms:
        raise InputError("The landmarks are those of a mirrored face: mirror the scan, or exchange _l and _r.")
    if len(names) > 5:  # leave each out in turn, see whether the rest agrees with itself
        k = int(residual.argmax())
        weights = np.ones(len(names))
        weights[k] = 1e-9
        without, _ = misfit(q, weights=weights)
        others = np.delete(without, k)
        if without[k] > ODD and without[k] > 4 * _rms(others):
            raise InputError(
                f'The landmark "{names[k]}" ({label(names[k])}) lies {without[k] * scale:.0f} mm from where the others '
                "expect it: place it again or leave it out."
            )
    if rms > UNLIKE:
        worst = names[int(residual.argmax())]
        raise InputError(
            f'The landmarks do not form a face ({rms:.0f} mm from any likeness, worst "{worst}"): check their names '
            "and places against the scan."
        )
    if not SCALE[0] < scale < SCALE[1]:
        raise InputError(
            f"The landmarks make a head {scale:.2g} times the size of an adult's: check the units of scan and "
            "landmarks."
        )


def _rms(x):
    return float(np.sqrt(np.mean(np.square(x))))
