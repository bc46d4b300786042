# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmark files: ``{"format": "headshop-landmarks/1", "units": "mm", "landmarks": {name: [x, y, z]}, "missing": []}``.

Any subset of four or more landmarks that do not lie in a plane is legal; further keys are tolerated. Files of found landmarks
have ``confidence`` {name: 0..1}, ``mid_air`` [name] and ``found`` {name: [x, y, z]}: a landmark that lies elsewhere than it was
found has been corrected, and is as good as any that was picked.
"""

import difflib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..anatomy import landmark_names
from ..anatomy.landmark_names import LABELS, SKIN, SKULL
from ..anatomy.storage import write_atomically
from ..errors import InputError
from ..finite_numbers import is_number
from ..json_keys import once
from ..landmarks.sure import SURE
from .thin_plate_spline import flatness

FORMAT = "headshop-landmarks/1"
LEAST = 4
FLAT = 0.03  # thickness over length below which landmarks count as lying in one plane

#: Pairs that do coincide on a closed mouth or a closed eye.
_MAY_TOUCH = ({"ls", "sto"}, {"sto", "li"}, {"ps_l", "pi_l"}, {"ps_r", "pi_r"}, {"n", "se"})


@dataclass(frozen=True, eq=False)
class LandmarkFile:
    """What a landmark file says: positions, name -> (3,) mm; found : name -> confidence 0..1, those of them that were found
    and not touched since."""

    positions: dict[str, np.ndarray]
    found: dict[str, float] = field(default_factory=dict)


def _suggestion(name: str) -> str:
    """`` (did you mean "prn" or "sn"?)`` for a name that is none, or the list of all names."""
    asked = name.strip().lower().replace("-", "_").replace(" ", "_")
    stem, _, side = asked.rpartition("_")
    side = {"left": "l", "right": "r"}.get(side, side)
    base = stem if side in ("l", "r") and stem else asked
    spoken = {label.split(",")[0].replace(" ", "_"): short for short, label in LABELS.items()}
    close = [spoken[w] for w in difflib.get_close_matches(base, spoken, n=2, cutoff=0.75)]
    close += difflib.get_close_matches(base, LABELS, n=2, cutoff=0.5)
    names = []
    for short in dict.fromkeys(close):
        names += [n for n in SKIN if n == short or n in (f"{short}_l", f"{short}_r")]
    if side in ("l", "r"):
        names = [n for n in names if n.endswith("_" + side)] or names
    names = names or difflib.get_close_matches(asked, SKIN, n=3, cutoff=0.4)
    if not names:
        return f"; the names are {' '.join(SKIN)}"
    return " (did you mean " + " or ".join(f'"{n}"' for n in names[:3]) + "?)"


def _position(path, name, value) -> np.ndarray:
    numeric = isinstance(value, list) and len(value) == 3
    if not numeric or not all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in value):
        raise InputError(f'{path}: landmark "{name}" is not three numbers [x, y, z]: give its place in mm.')
    if not all(map(is_number, value)):
        raise InputError(
            f'{path}: landmark "{name}" is not a finite number: give its place in mm, or list it under "missing".'
        )
    return np.array(value, dtype=float)


def read_landmarks(path) -> dict[str, np.ndarray]:
    """Landmark name -> (3,) mm of a landmark file, see `read_landmark_file`."""
    return read_landmark_file(path).positions


def read_landmark_file(path) -> LandmarkFile:
    """The `LandmarkFile` at ``path``; names listed as missing are left out, and so are those that were found, but in
    mid-air or hardly surely, and not corrected.

    Raises
    ------
    InputError : no such file, no JSON, another format or unit, an unknown name, a name given twice, a place that is not
        three finite numbers, two landmarks in one place, fewer than four, or all in one plane.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"There is no landmark file {path}: check the path.") from None
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else "it is not a text file"
        raise InputError(f"The landmark file {path} cannot be read ({why}): choose a JSON landmark file.") from None
    try:
        document = json.loads(text, object_pairs_hook=once)
    except KeyError as error:
        raise InputError(f'{path} gives "{error.args[0]}" twice: keep the right one.') from None
    except (ValueError, RecursionError) as error:
        where = f" (line {error.lineno}: {error.msg})" if isinstance(error, json.JSONDecodeError) else ""
        raise InputError(f"{path} is no JSON{where}: choose a landmark file of format {FORMAT}.") from None
    return parse_landmarks(document, str(path))


def parse_landmarks(document, source: str = "The landmark file") -> LandmarkFile:
    """Like `read_landmark_file`, from the parsed JSON; ``source`` begins the sentences about what is wrong."""
    if not isinstance(document, dict) or "format" not in document:
        raise InputError(f'{source} is no landmark file: it needs "format": "{FORMAT}".')
    if document["format"] != FORMAT:
        raise InputError(f"{source} is of format {document['format']!r}; this version reads {FORMAT}: convert it.")
    units = document.get("units", "mm")
    if units != "mm":
        raise InputError(f'{source} says units {units!r}: give the landmarks in millimetres and write "units": "mm".')
    given, missing = document.get("landmarks"), document.get("missing") or []
    if not isinstance(given, dict):
        raise InputError(f'{source} has no "landmarks": {{name: [x, y, z]}}: add the places of at least {LEAST}.')
    if not isinstance(missing, list):
        raise InputError(f'{source}: "missing" is no list: write the names as ["v", "op"].')
    for name in [*given, *(m for m in missing if isinstance(m, str))]:
        if name not in SKIN:
            raise InputError(f'{source} names an unknown landmark "{name}"{_suggestion(name)}.')
    found = _found(document)
    sure = {n for n, c in found.items() if c >= SURE}
    left = {m for m in missing if isinstance(m, str)} | (found.keys() - sure)
    positions = {n: _position(source, n, p) for n, p in given.items() if n not in left}
    if len(positions) < LEAST <= len(given):
        raise InputError(
            f"{source} has {len(given)} landmarks, of which {len(positions) or 'none'} can be used, for the others are "
            f'listed under "missing", or were found hardly surely or in mid-air: place at least {LEAST} by hand, such as '
            "ex_l, ex_r, prn and gn."
        )
    require_usable(positions, source)
    return LandmarkFile(positions, {n: found[n] for n in found if n in positions})


def _found(document) -> dict[str, float]:
    """Name -> confidence of the landmarks that were found and lie where they were; 0 in mid-air, which is no evidence to
    fit a head to."""
    confidence, mid_air = document.get("confidence"), document.get("mid_air")
    if not isinstance(confidence, dict) or not isinstance(mid_air, list):
        return {}
    given, places = document["landmarks"], document.get("found")
    same = {n for n in given if not isinstance(places, dict) or places.get(n) == given[n]}
    sure = {n: float(c) for n, c in confidence.items() if n in same and is_number(c)}
    return sure | {n: 0.0 for n in mid_air if isinstance(n, str) and n in same}


def usable(landmarks: dict[str, np.ndarray], source: str) -> dict[str, np.ndarray]:
    """Name -> (3,) mm of the skin's landmarks that a program gives, the skull's left out; raises `InputError` where
    `require_usable` does, for what is no dict, and for names and places that are none."""
    if not isinstance(landmarks, Mapping):
        raise InputError(
            f"{source} is given as {type(landmarks).__name__}: give a dict of names and places in mm, such as "
            '{"prn": [x, y, z]}.'
        )
    given = {}
    for name, place in landmarks.items():
        if name in SKULL and name not in SKIN:
            continue
        if name not in SKIN:
            raise InputError(f'{source} names an unknown landmark "{name}"{_suggestion(str(name))}.')
        try:
            given[name] = np.asarray(place, dtype=float)
        except (TypeError, ValueError):
            given[name] = np.full(3, np.nan)
        if given[name].shape != (3,) or not np.isfinite(given[name]).all():
            raise InputError(
                f'{source}: landmark "{name}" is not three finite numbers [x, y, z]: give its place in mm.'
            )
    require_usable(given, source)
    return given


def require_usable(positions: dict[str, np.ndarray], source: str = "The landmark file") -> None:
    """Raise `InputError` unless there are four or more landmarks, not in one plane, no two in one place."""
    if len(positions) < LEAST:
        raise InputError(
            f"{source} gives {len(positions)} landmark{'s' * (len(positions) != 1)}; a head needs at least {LEAST} "
            "that do not lie in one plane: add some, such as ex_l, ex_r, prn and gn."
        )
    names = list(positions)
    points = np.array([positions[n] for n in names], dtype=float)
    order = np.lexsort(points.T)
    for i, j in zip(order[:-1], order[1:], strict=True):
        if np.array_equal(points[i], points[j]) and {names[i], names[j]} not in _MAY_TOUCH:
            raise InputError(f'{source} puts "{names[i]}" and "{names[j]}" in the same place: correct one of them.')
    if flatness(points) < FLAT:
        sides = any(n.endswith(("_l", "_r")) for n in names)
        add = "such as prn (the tip of the nose) or t_l and t_r" if sides else "such as ex_l and ex_r"
        raise InputError(
            f"{source} gives {len(names)} landmarks that lie in one plane, which cannot place a head: add others, "
            f"{add}."
        )


def write_landmarks(path, positions: dict[str, np.ndarray], missing=(), confidence=None, mid_air=()) -> None:
    """Write a landmark file: positions in mm (skin or skull landmarks), and the names that were ``missing``.

    confidence : name -> 0..1 and ``mid_air`` names, of those that were found and not corrected
    """
    order = {name: k for k, name in enumerate((*SKIN, *(n for n in landmark_names.SKULL if n not in SKIN)))}
    names = sorted(positions, key=order.__getitem__)
    document = {
        "format": FORMAT,
        "units": "mm",
        "landmarks": {n: [round(float(x), 4) for x in positions[n]] for n in names},
        "missing": sorted(missing, key=order.__getitem__),
    }
    if confidence is not None:
        document["mid_air"] = sorted(mid_air, key=order.__getitem__)
        document["confidence"] = {n: round(float(confidence[n]), 3) for n in names if n in confidence}
        document["found"] = {n: document["landmarks"][n] for n in document["confidence"]}
    write_atomically(path, (json.dumps(document, indent=1) + "\n").encode())
