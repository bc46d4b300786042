# SPDX-License-Identifier: GPL-3.0-or-later
"""In which unit a scan is measured, which of its axes points up and where the face looks."""

from dataclasses import dataclass

import numpy as np

from ..anatomy.head import Head
from ..anatomy.storage import reference_head
from ..errors import InputError
from ..mesh import Mesh
from ..progress import Progress, Work, finish, portion
from .face_match import best_turns, face_template, surface_samples
from .units import (
    BY_FACE,
    CUSTOM,
    SMALLEST,
    is_human,
    larger_units,
    no_head,
    sizes_to_try,
    unit_of_landmarks,
    unit_words,
    units_of,
)

FOUND = "the landmarks that were found"
LOOKING = "Finding out which way is up"
AXES = {sign + name: s * np.eye(3)[k] for k, name in enumerate("XYZ") for sign, s in (("+", 1.0), ("-", -1.0))}

#: A second orientation that fits this much worse is no rival; a worse fit than this (mm) is no face.
RIVAL, POOR = 1.25, 4.5
#: mm: better fits than these are a face beyond doubt, and one of about the size it was looked for. Scans in their own unit,
#: MakeHuman's children and a CT's among them, have 1.3 to 3.2, half of them more than the second; the reference 30 % too large
#: has 3.0; animals, parts and balls in any size 3.4 and more.
PLAIN, OWN = 3.3, 2.4
OTHER = 1.3  # times a size that is plainly not its own: another that is tried
#: Degrees by which a head is held or turned at most in a scan that stands and faces along its axes; and between its up and an
#: axis that is taken for up where the face looks along none. In a scan of no unit axes are as good as any: `LOOSE` is both.
HELD, LEVEL, LOOSE = 35.0, 25.0, 15.0


@dataclass(frozen=True, eq=False)
class Orientation:
    """How a scan's own coordinates become millimetres, +Z up, the face toward -Y.

    Attributes
    ----------
    unit : name from `units.UNITS`, `CUSTOM` or `BY_FACE`
    unit_scale : mm per scan unit
    up, front : the scan's own axes that point up and where the face looks, like ``+Z`` and ``-Y``, or are nearest to that
    rotation : (3, 3) proper. It permutes and flips axes only, so that the scan keeps its place and the head the way it is held;
        unless landmarks tell that the head is turned farther from them than it would be held
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


def detect(mesh: Mesh, landmarks: dict[str, np.ndarray] | None = None, **options) -> Orientation:
    """What `detecting`, which takes the same, finds."""
    return finish(detecting(mesh, landmarks, **options))


def detecting(
    mesh: Mesh,
    landmarks: dict[str, np.ndarray] | None = None,
    *,
    unit: str | float | None = None,
    up: str | None = None,
    front: str | None = None,
    reference: Head | None = None,
    called: str = CUSTOM,
    picked: bool = True,
) -> Work:
    """Work returning the `Orientation` of a scan: what is given as ``unit``, ``up`` or ``front`` is not questioned.

    landmarks : name -> (3,) mm along the scan's own axes; three or more not on a line decide the axes and the unit.
    Without them the face of the reference head is laid on the scan in all 24 positions, and the best fit wins; if it
    fits in no usual unit, in any size, and the unit is such that the head is as large as the reference.
    called : what a unit is called that is given as a number
    picked : whether somebody gave the landmarks; the ``reason`` says so

    Raises
    ------
    InputError : the scan is no head in any unit, or an override is not understood.
    """
    yield Progress(0.0, LOOKING)
    reference = reference or reference_head()
    allowed = _allowed(up, front)
    points = surface_samples(mesh)
    units = units_of(points, unit, called)
    if landmarks is not None:
        turn = _turn_of_landmarks(landmarks, reference.landmark_positions())
        if turn is not None:
            usual = units if unit is not None else [*units, *larger_units(points)]
            name, scale = unit_of_landmarks(points, landmarks, usual, unit is not None)
            return _by_landmarks(turn, allowed, name, scale, picked)
    template = face_template(reference)
    found = yield from portion(_placements(points, template, allowed, units), 0.0, 0.3)
    if unit is None and not (found and found[0][0] < OWN):
        near = found and found[0][0] < PLAIN
        sizes = [found[0][2] / OTHER, found[0][2] * OTHER] if near else sizes_to_try(points)
        guesses = [(BY_FACE, scale) for scale in sizes]
        guesses = yield from portion(_placements(points, template, allowed, guesses), 0.3, 0.9)
        if guesses[0][0] < min([PLAIN, *(entry[0] for entry in found)]):
            found = yield from portion(_sized(points, template, allowed, guesses[0], units), 0.9, 1.0)
    if not found:
        found = yield from portion(_placements(points, template, allowed, larger_units(points)), 0.9, 1.0)
    if not found:
        raise no_head(points)
    misfit, name, scale, rotation, _ = found[0]
    rivals = [e for e in found[1:] if e[1] != name or not np.allclose(e[3], rotation)]
    up, front = axis_names(rotation)
    extent = np.ptp(points, axis=0).max() * scale
    reason = f"read as {unit_words(name, scale)} ({extent:.0f} mm across), {up} up, face toward {front}"
    certain = not rivals or (misfit < POOR and rivals[0][0] > RIVAL * misfit)
    if unit is not None and len(allowed) == 1:
        reason, certain = reason + ", as told", True
    elif misfit >= POOR:
        reason += f"; unsure, because nothing in the scan resembles a face (misfit {misfit:.1f} mm)"
    elif not certain:
        other = rivals[0]
        what = "{} up, face toward {}".format(*axis_names(other[3])) if other[1] == name else f"{other[1]} for the unit"
        reason += f"; unsure, because {what} fits nearly as well ({other[0]:.1f} mm against {misfit:.1f} mm)"
    else:
        reason += f" (a face fits to {misfit:.1f} mm)"
    return Orientation(name, scale, up, front, rotation, certain, reason[0].upper() + reason[1:] + ".")


def _placements(points, template, allowed, units) -> Work:
    """Work returning where the face of the ``template`` lies on ``points`` in each of ``units``, best first: misfit mm, unit,
    scale, rotation, size of the reference's."""
    found = []
    for k, (name, scale) in enumerate(units):
        yield Progress(k / len(units), LOOKING)
        turns = best_turns(points * scale, template, allowed)
        found += [(misfit, name, scale, turn, size) for misfit, turn, size in turns]
    return sorted(found, key=lambda entry: entry[0])


def _sized(points, template, allowed, guess, units) -> Work:
    """Work returning `_placements` where the ``guess``, one of them, lies: in the one of ``units`` that makes the head a
    person's; if none does it is as large as the reference, which is as good a guess as any."""
    _, _, scale, _, size = guess
    again = yield from _placements(points, template, allowed, [(BY_FACE, scale / size)])
    _, _, scale, _, size = again[0]
    usual = (unit for unit in units if is_human(size * unit[1] / scale, SMALLEST))
    unit = next(usual, (BY_FACE, scale / size))
    return [(misfit, *unit, turn, size) for misfit, _, _, turn, size in again]


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


def axis_names(rotation: np.ndarray) -> tuple[str, str]:
    """Which of a scan's axes are nearest to up and to where the face looks, like ``+Z`` and ``-Y``; ``rotation`` : as of
    `Orientation`."""
    nearest = _nearest(rotations(), rotation)

    def name(v):
        return next(k for k, axis in AXES.items() if axis @ v > 0.5)

    return name(nearest[2]), name(-nearest[1])


def read_as(name: str, scale: float, rotation: np.ndarray) -> str:
    """How a scan was read, in words: its unit, which of its axes are which, and how far it was turned from them."""
    words = "Read as {}, {} up, face toward {}".format(unit_words(name, scale), *axis_names(rotation))
    turned = _angle(_nearest(rotations(), rotation), rotation)
    return f"{words}, and turned by {turned:.0f} degrees to stand upright and face forward" if turned > 1 else words


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
    return [r for r in rotations() if up in (None, axis_names(r)[0]) and front in (None, axis_names(r)[1])]


def _turn_of_landmarks(given, canonical):
    """The rotation (3, 3) that takes the landmarks to the reference's directions (Kabsch 1976); None if on a line."""
    names = [n for n in given if n in canonical and np.isfinite(given[n]).all()]
    if len(names) < 3:
        return None
    a = np.array([given[n] for n in names], dtype=float)
    b = np.array([canonical[n] for n in names])
    u, s, vt = np.linalg.svd((b - b.mean(axis=0)).T @ (a - a.mean(axis=0)))
    if s[1] < 1e-3 * s[0]:
        return None
    return u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt


def _by_landmarks(turn, allowed, name, scale, picked):
    rotation = _nearest(allowed, turn)
    held, level = (LOOSE, LOOSE) if name == BY_FACE else (HELD, LEVEL)
    if _angle(rotation, turn) >= held:
        rotation = _stood(turn, rotation, allowed, level)
    tilt = _angle(rotation, turn)
    up, front = axis_names(rotation)
    certain = bool(tilt < HELD)
    reason = read_as(name, scale, rotation)
    marks = "the landmarks" if picked else FOUND
    if certain:
        reason += f": {marks} say so"
    else:
        reason += f", but by {marks} the head is turned by {tilt:.0f} degrees from these axes: check them"
    return Orientation(name, scale, up, front, rotation, certain, reason + ".")


def _stood(turn, rotation, allowed, level):
    """The rotation for a head that ``turn`` would set upright, and that nobody holds as ``rotation``, the nearest of those
    ``allowed``, would leave it.

    Where the scan's own axis is up, or was told to be, it turns about that, and the head stays as it is held: a body may stand
    at any angle in its room.
    """
    up = rotation[2]
    told = len({tuple(r[2]) for r in allowed}) == 1
    if len(allowed) < len(rotations()) and not (told and len(allowed) > 1):
        return rotation
    back = turn[1] - (turn[1] @ up) * up
    if np.linalg.norm(back) < 0.5:
        return rotation if told else turn
    if not told and up @ turn[2] < np.cos(np.radians(level)):
        return turn
    back /= np.linalg.norm(back)
    return np.stack([np.cross(back, up), back, up])


def _nearest(allowed, turn):
    return max(allowed, key=lambda r: np.trace(r.T @ turn))


def _angle(one, other) -> float:
    """Degrees between two rotations."""
    return float(np.degrees(np.arccos(np.clip((np.trace(one.T @ other) - 1) / 2, -1, 1))))
