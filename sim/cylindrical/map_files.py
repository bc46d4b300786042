# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of range maps: Cyberware's (``.ech``), numpy's (``.npz``) and a pair of images with a description (``.json``).

The description of the last, and the arrays of the second, carry the same names:

    format             ``headshop-range/1``
    radius             .npz: (h, w) mm, NaN in voids; .json: file name of a 16-bit grey PNG, 0 in voids
    radius_unit_mm     .json: mm per step of the PNG
    colour             .npz: (h, w, 3) 0..1 or uint8, optional; .json: file name of an RGB PNG, optional
    longitude_first    rad of the first column from the front toward the subject's left; default: front midway
    longitude_step     rad between columns; default: the columns close the circle
    height_top         mm of the first row; default: the rows are centred on the origin
    height_step        mm between rows; the only one that has no default
    origin, axes       (3,) mm and (3, 3): the axis in the scan's place, see `RangeMap`; default: through the origin, +Z up

The first row is at the top and columns run from the subject's right to the left, as a picture of the face does.
"""

import io
import json
import os
from pathlib import Path

import numpy as np

from ..anatomy.storage import write_atomically
from ..errors import InputError
from ..file_bytes import file_bytes
from ..finite_numbers import is_number
from .echo_file import colour_path, echo_bytes, is_echo, parse_echo, with_colour
from .png_image import png_bytes, read_png
from .range_map import TURN, RangeMap
from .sgi_image import read_sgi, sgi_bytes

FORMAT = "headshop-range/1"
EXTENSIONS = (".ech", ".npz", ".json")
#: mm per step of the range image that is written: 65535 of them are 655 mm.
UNIT = 0.01
_MOST = 16384


def is_range_map(path) -> bool:
    """Whether the file at ``path`` is a range map: by its extension, or by how it begins (Echo's often have none)."""
    path = Path(path)
    if path.suffix.lower() in EXTENSIONS:
        return True
    if path.suffix.lower() in ("", ".cyb", ".cyber", ".echo"):
        try:
            with path.open("rb") as stream:
                return is_echo(stream.read(128))
        except OSError:
            return False
    return False


def read_range_map(path) -> RangeMap:
    """The range map in a file, with the colours of its colour file if there is one.

    Raises
    ------
    InputError : the file or its images cannot be read, are damaged or not what their names say, or hold no radius.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind == ".npz":
        return _from_npz(path)
    if kind == ".json":
        return _from_json(path)
    beside = colour_path(path)
    return parse_echo(file_bytes(path), str(path), None if beside is None else _image(beside))


def write_range_map(path, range_map: RangeMap) -> list[Path]:
    """Write a map as what the extension of ``path`` says; returns the files written (colours beside the range).

    Raises
    ------
    InputError : another extension, or a file cannot be written there.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in EXTENSIONS:
        raise InputError(f"{path.name} is no name of a range map: end it in {', '.join(EXTENSIONS)}.")
    colour = range_map.colour
    files: dict[Path, bytes] = {}
    if kind == ".ech":
        if colour is not None:
            files[path.with_suffix(".color")] = sgi_bytes(colour[:, ::-1])
        files[path] = echo_bytes(range_map, path.stem)
    elif kind == ".npz":
        arrays = {"format": np.array(FORMAT), "radius": range_map.radius.astype(np.float32)}
        if colour is not None:
            arrays["colour"] = colour
        stream = io.BytesIO()
        np.savez_compressed(stream, **arrays, **{k: np.array(v) for k, v in _frame(range_map).items()})
        files[path] = stream.getvalue()
    else:
        document = {"format": FORMAT, "radius": path.stem + ".range.png", "radius_unit_mm": UNIT}
        steps = np.clip(np.rint(np.where(range_map.valid, range_map.radius, 0) / UNIT), 0, 65535)
        files[path.with_name(document["radius"])] = png_bytes(steps.astype(np.uint16))
        if colour is not None:
            document["colour"] = path.stem + ".colour.png"
            pixels = np.clip(np.rint(np.nan_to_num(colour) * 255), 0, 255).astype(np.uint8)
            files[path.with_name(document["colour"])] = png_bytes(pixels)
        files[path] = (json.dumps(document | _frame(range_map), indent=1) + "\n").encode()
    for file, data in files.items():
        write_atomically(file, data)
    return list(files)


def _frame(range_map: RangeMap) -> dict:
    return {
        "longitude_first": range_map.first,
        "longitude_step": range_map.step,
        "height_top": range_map.top,
        "height_step": range_map.rise,
        "origin": np.asarray(range_map.origin).tolist(),
        "axes": np.asarray(range_map.axes).tolist(),
    }


def _image(path: Path) -> np.ndarray:
    """(h, w, 3) 0..1 of a colour file."""
    data = file_bytes(path)
    if path.suffix.lower() != ".png":
        return read_sgi(data, str(path))
    pixels = read_png(data, str(path))
    image = pixels.astype(np.float32) / np.iinfo(pixels.dtype).max
    return image[..., :3] if image.shape[2] >= 3 else image[..., :1].repeat(3, axis=2)


def _from_npz(path: Path) -> RangeMap:
    try:
        with np.load(io.BytesIO(file_bytes(path)), allow_pickle=False) as file:
            given = {key: file[key] for key in file.files}
    except (ValueError, OSError, KeyError, EOFError, TypeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} is no .npz file of arrays, or damaged: save it again with numpy.savez.") from None
    except Exception as error:  # zipfile and zlib have their own
        if type(error).__name__ in ("BadZipFile", "error"):
            raise InputError(f"{path} is no .npz file of arrays, or damaged: save it again with numpy.savez.") from None
        raise
    if "radius" not in given or given["radius"].ndim != 2 or given["radius"].dtype.kind not in "fiu":
        raise InputError(
            f"{path} has no array radius (rows, columns) of numbers: add it (docs/fitting.md lists all arrays)."
        )
    colour = given.get("colour")
    if colour is not None and colour.dtype.kind in "ui":
        colour = colour.astype(np.float32) / np.iinfo(colour.dtype).max
    return _assembled(path, given["radius"].astype(float), colour, given)


def _from_json(path: Path) -> RangeMap:
    try:
        given = json.loads(file_bytes(path).decode("utf-8-sig"))
    except (ValueError, RecursionError):
        raise InputError(f"{path} is no JSON: give the description of a range map ({FORMAT}).") from None
    if not isinstance(given, dict) or given.get("format") != FORMAT or not isinstance(given.get("radius"), str):
        raise InputError(f'{path} describes no range map: it needs "format": "{FORMAT}" and "radius": a 16-bit PNG.')
    beside = _beside(path, given["radius"])
    pixels = read_png(file_bytes(beside), str(beside))
    if pixels.dtype != np.uint16 or pixels.shape[2] > 2:
        raise InputError(f"{beside} is not a grey PNG of 16 bits: save the ranges as one.")
    unit = given.get("radius_unit_mm", UNIT)
    if not is_number(unit) or not 0 < unit < 1000:
        raise InputError(f'{path} says "radius_unit_mm": {unit!r}, which is no number of mm: correct it.')
    radius = np.where(pixels[..., 0] > 0, pixels[..., 0] * float(unit), np.nan)
    colour = None
    if given.get("colour") is not None:
        made = _assembled(path, radius, None, given)
        return with_colour(made, _image(_beside(path, given["colour"])))
    return _assembled(path, radius, colour, given)


def _beside(path: Path, name) -> Path:
    """The image that the description at ``path`` names, from its folder on."""
    file = path.parent / name if isinstance(name, str) and "\0" not in name else path.parent
    if os.path.isdir(file):
        raise InputError(f"{path} names an image {name!r}, which is no file: give the name of a file beside it.")
    return file


def _assembled(path, radius, colour, given) -> RangeMap:
    """The map of arrays and the description ``given``, everything checked."""
    h, w = radius.shape
    if not (2 <= h <= _MOST and 3 <= w <= _MOST):
        raise InputError(f"{path} is a map of {h} x {w} radii: give one of 2 x 3 to {_MOST} x {_MOST}.")
    valid = np.isfinite(radius) & (radius > 0)
    if not valid.any():
        raise InputError(f"{path} holds no radius, all are void: export the scan again.")
    if colour is not None and colour.shape != (h, w, 3):
        raise InputError(f"{path} has colours of shape {colour.shape} for {h} x {w} radii: give ({h}, {w}, 3).")
    if "height_step" not in given:
        raise InputError(f"{path} does not say height_step, the mm between its rows: add it.")
    rise = _numbers(path, given, "height_step", None, ())
    step = _numbers(path, given, "longitude_step", TURN / w, ())
    top = _numbers(path, given, "height_top", float(rise) * (h - 1) / 2, ())
    first = _numbers(path, given, "longitude_first", -float(step) * (w - 1) / 2, ())
    origin = _numbers(path, given, "origin", np.zeros(3), (3,))
    axes = _numbers(path, given, "axes", np.eye(3), (3, 3))
    if not (0 < rise < 1e4 and 0 < step and step * w < TURN * 1.01):
        raise InputError(f"{path}: height_step {rise:g} mm or longitude_step {step:g} rad makes no sense: correct it.")
    if not np.allclose(axes @ axes.T, np.eye(3), atol=1e-3) or np.linalg.det(axes) < 0:
        raise InputError(f"{path}: axes are not three directions at right angles, left, back and up: correct them.")
    radius = np.where(valid, radius, np.nan)
    colour = None if colour is None else colour.astype(np.float32)
    return RangeMap(radius, valid, colour, float(first), float(step), float(top), float(rise), origin, axes)


def _numbers(path, given, key, fallback, shape) -> np.ndarray:
    try:
        value = np.asarray(given.get(key, fallback), dtype=float)
    except (TypeError, ValueError, OverflowError):
        value = np.array(np.nan)
    if value.shape != shape or not np.isfinite(value).all():
        raise InputError(
            f"{path}: {key} is not {'a number' if shape == () else f'numbers of shape {shape}'}: correct it."
        )
    return value
