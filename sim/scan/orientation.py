# SPDX-License-Identifier: GPL-3.0-or-later
"""In which unit a scan is measured, which of its axes points up and where the face looks."""

from dataclasses import dataclass

import numpy as np

from ..anatomy.head import Head
from ..anatomy.storage import reference_head
from ..errors import InputError
from ..mesh import Mesh
from .face_match import best_turns, face_template, surface_samples

#: Unit -> mm.
UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}

#: Largest extent of a scan of a face patch (the smallest) and of a bust (the largest), mm.
PLAUSIBLE = (90.0, 900.0)
BODY = 2600.0  # mm, the same of somebody from head to foot: taken for that only if no unit makes a head of it

AXES = {sign + name: s * np.eye(3)[k] for k, name in enumerate("XYZ") for sign, s in (("+", 1.0), ("-", -1.0))}

#: A second orientation that fits this much worse is no rival; a worse fit than this (mm) is no face.
RIVAL, POOR = 1.25, 4.5


@dataclass(frozen=True, eq=False)
class Orientation:
    """How a scan's own coordinates become millimetres, +Z up, the face toward -Y.

    Attributes
    ----------
    unit : name from `UNITS`, or ``custom``
    unit_scale : mm per scan unit
    up, front : the scan's own axes that point up and where the face looks, like ``+Z`` and ``-Y``
    rotation : (3, 3) proper, permutes and flips axes only: the scan keeps its own place and tilt
    certain : False when another reading is nearly as good; ``reason`` then says so
    reason : one sentence for the report
    """

    unit: str
    unit_scale: float
    up: str
    front: str
    rotation: np.ndarray
    certain: bool
    reason: str

    @property
    def matrix(self) -> np.ndarray:
        """(4, 4) from the scan's coordinates to mm, +Z up, face toward -Y."""
        out = np.eye(4)
        out[:3, :3] = self.unit_scale * self.rotation
        return out

    def apply(self, points: np.ndarray) -> np.ndarray:
        """Points (n, 3) in the scan's coordinates -> mm, +Z up, face toward -Y."""
        return self.unit_scale * np.asarray(points, dtype=float) @ self.rotation.T

    def inverse(self, points: np.ndarray) -> np.ndarray:
        """What `apply` maps to ``points`` (n, 3)."""
        return np.asarray(points, dtype=float) @ self.rotation / self.unit_scale

    def turn(self, landmarks: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Landmarks given in mm along the scan's own axes -> +Z up, face toward -Y."""
        return {name: self.rotation @ np.asarray(p, dtype=float) for name, p in landmarks.items()}


def detect(
    mesh: Mesh,
    landmarks: dict[str, np.ndarray] | None = None,
    *,
    unit: str | float | None = None,
    up: str | None = None,
    front: str | None = None,
    reference: Head | None = None,
) -> Orientation:
    """Unit, up axis and front of a scan; what is given as ``unit``, ``up`` or ``front`` is not questioned.

    landmarks : name -> (3,) mm along the scan's own axes; three or more not on a line decide the axes and the unit.
    Without them the face of the reference head is laid on the scan in all 24 positions, and the best fit wins.

    Raises
    ------
    InputError : no unit makes the scan as large as a head, or an override is not understood.
    """
    reference = reference or reference_head()
    allowed = _allowed(up, front)
    points = surface_samples(mesh)
    units = _units(points, unit)
    if landmarks is not None:
        turn, spread = _turn_of_landmarks(landmarks, reference.landmark_positions())
        if turn is not None:
            name, scale = _unit_of_landmarks(points, landmarks, units)
            return _by_landmarks(turn, spread, allowed, name, scale)
    template = face_template(reference)
    found = []  # (misfit mm, unit, scale, rotation)
    for name, scale in units:
        found += [(misfit, name, scale, turn) for misfit, turn in best_turns(points * scale, template, allowed)]
    found.sort(key=lambda entry: entry[0])
    misfit, name, scale, rotation = found[0]
    rivals = [e for e in found[1:] if e[1] != name or not np.allclose(e[3], rotation)]
    up, front = _names(rotation)
    extent = np.ptp(points, axis=0).max() * scale
    reason = f"read as {_unit_words(name, scale)} ({extent:.0f} mm across), {up} up, face toward {front}"
    certain = not rivals or (misfit < POOR and rivals[0][0] > RIVAL * misfit)
    if unit is not None and len(allowed) == 1:
        reason, certain = reason + ", as told", True
    elif misfit >= POOR:
        reason += f"; unsure, because nothing in the scan resembles a face (misfit {misfit:.1f} mm)"
    elif not certain:
        other = rivals[0]
        what = "{} up, face toward {}".format(*_names(other[3])) if other[1] == name else f"{other[1]} for the unit"
        reason += f"; unsure, because {what} fits nearly as well ({other[0]:.1f} mm against {misfit:.1f} mm)"
    else:
        reason += f" (a face fits to {misfit:.1f} mm)"
    return Orientation(name, scale, up, front, rotation, certain, reason[0].upper() + reason[1:] + ".")


def plausible_units(mesh: Mesh, unit: str | float | None = None) -> dict[str, float]:
    """Unit -> mm, of those in which the scan is as large as a head; only ``unit`` where it is given.

    Raises
    ------
    InputError : there is none, or ``unit`` is not understood.
    """
    return dict(_units(surface_samples(mesh), unit))


def rotations() -> list[np.ndarray]:
    """The 24 proper rotations that permute and flip axes, the identity first, then Y up with the face toward +Z."""
    out = []
    for up in ("+Z", "+Y", "-Y", "+X", "-X", "-Z"):
        for front in ("-Y", "+Z", "+Y", "-Z", "+X", "-X"):
            if up[1] != front[1]:
                out.append(_rotation(up, front))
    return out


def _rotation(up: str, front: str) -> np.ndarray:
    """Rows are the scan's directions of the subject's left, the back and up."""
    back, top = -AXES[front], AXES[up]
    return np.stack([np.cross(back, top), back, top])


def _names(rotation):
    def name(v):
        return next(k for k, axis in AXES.items() if axis @ v > 0.5)

    return name(rotation[2]), name(-rotation[1])


def _axis(text: str | None) -> str | None:
    if text is None:
        return None
    name = str(text).strip().upper()
    name = name if name[:1] in ("+", "-") else "+" + name
    if name not in AXES:
        raise InputError(f"{text!r} is no axis: give one of +X, -X, +Y, -Y, +Z, -Z.")
    return name


def _allowed(up, front):
    up, front = _axis(up), _axis(front)
    if up and front and up[1] == front[1]:
        raise InputError(f"The scan cannot have {up} up and its face toward {front}: give two different axes.")
    return [r for r in rotations() if up in (None, _names(r)[0]) and front in (None, _names(r)[1])]


def _units(points, unit) -> list[tuple[str, float]]:
    if isinstance(unit, str) and unit.strip().lower() in UNITS:
        name = unit.strip().lower()
        return [(name, UNITS[name])]
    if unit is not None:
        try:
            scale = float(unit)
        except ValueError:
            scale = float("nan")
        if not 0 < scale < float("inf"):
            raise InputError(f"{unit!r} is no unit: give mm, cm, m, in, or millimetres per unit as a number.")
        return [("custom", scale)]
    extent = np.ptp(points, axis=0).max()
    least, most = PLAUSIBLE
    units = [(name, scale) for name, scale in UNITS.items() if least <= extent * scale <= most]
    units = units or [(name, scale) for name, scale in UNITS.items() if most < extent * scale <= BODY]
    if not units:
        raise InputError(
            f"The scan is {extent:.4g} units across, which is no head in mm, cm, m or inches: give the unit, as a name "
            "or as millimetres per unit."
        )
    return units


def _unit_words(name, scale):
    words = {"mm": "millimetres", "cm": "centimetres", "m": "metres", "in": "inches"}
    return words.get(name, f"units of {scale:g} mm")


def _turn_of_landmarks(given, canonical):
    """The rotation (3, 3) that takes the landmarks to the reference's directions (Kabsch 1976); None if on a line."""
    names = [n for n in given if n in canonical and np.isfinite(given[n]).all()]
    if len(names) < 3:
        return None, 0.0
    a = np.array([given[n] for n in names], dtype=float)
    b = np.array([canonical[n] for n in names])
    u, s, vt = np.linalg.svd((b - b.mean(axis=0)).T @ (a - a.mean(axis=0)))
    if s[1] < 1e-3 * s[0]:
        return None, 0.0
    return u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt, s[1] / s[0]


def _unit_of_landmarks(points, landmarks, units):
    """The unit in which the landmarks lie nearest to the scan."""
    from scipy.spatial import cKDTree

    marks = np.array([p for p in landmarks.values() if np.isfinite(p).all()], dtype=float)
    return min(units, key=lambda u: np.median(cKDTree(points * u[1]).query(marks)[0]))


def _by_landmarks(turn, spread, allowed, name, scale):
    rotation = max(allowed, key=lambda r: np.trace(r.T @ turn))
    tilt = np.degrees(np.arccos(np.clip((np.trace(rotation.T @ turn) - 1) / 2, -1, 1)))
    up, front = _names(rotation)
    certain = bool(tilt < 35)
    reason = f"Read as {_unit_words(name, scale)}, {up} up, face toward {front}: the landmarks say so"
    if not certain:
        reason += f", but the head is turned by {tilt:.0f} degrees from these axes: check them"
    return Orientation(name, scale, up, front, rotation, certain, reason + ".")
