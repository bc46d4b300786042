# SPDX-License-Identifier: GPL-3.0-or-later
"""The heads that `skin_average` measures, with their landmarks; they are not part of the package.

ICT-FaceKit (MIT) with three random individuals, MakeHuman (CC0), Lee Perry-Smith's head (CC-BY), a head of menpo (BSD)
and one of Cyberware. Parts that hair, smile or the scanner's shadow spoil are left out. The folder holds
``ict/neutral.ply`` with landmarks and ``ict/examples``, ``makehuman/mh_heads.npz`` and ``scans``.
"""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...sim.scan.ply import read_ply
from .skin_rays import MeasuredHead

#: Share of each head in the mean. The first is itself a mean of many.
SHARES = {
    "ict_neutral": 0.30,
    **{f"ict_{name}": 0.04 for name in ("s1", "s2", "s3")},
    "lps_infinite": 0.22,
    "menpo_james": 0.14,
    "fran_cyberware": 0.06,
    **{"caucasian_male_young": 0.04, "caucasian_female_young": 0.04},
    **{"african_male_young": 0.04, "asian_female_young": 0.04},
}

#: Landmarks read off the MakeHuman base head by eye, as rays (see `skin_controls`), mm in its own frame.
_MAKEHUMAN = {
    **{"en": ("F", 17, 18.5), "ex": ("F", 44.5, 18.5), "ps": ("F", 31, 24.8), "pi": ("F", 31, 14.6)},
    **{"sn": ("F", 0, -28.5), "ls": ("F", 0, -40), "cph": ("F", 6.5, -38.7), "li": ("F", 0, -59.5)},
    **{"ch": ("F", 25.8, -48), "al": ("F", 17, -16), "g": ("F", 0, 32), "n": ("F", 0, 22), "pg": ("F", 0, -80)},
    **{"t": ("S", 17.5, 2), "sa": ("S", 26, 24.5), "sba": ("S", 20, -25.5), "pa": ("S", 42, 6), "gn": ("D", 0, -56)},
    "prn": ("F", 0, -15),
}


def _everything(at: np.ndarray) -> np.ndarray:
    return np.ones(len(at), dtype=bool)


def _without_hair(at: np.ndarray) -> np.ndarray:
    x, y, z = at.T
    return (y < -48) & (abs(x) < 60) & (z > -96) & (z < 76)


def _without_smile(at: np.ndarray) -> np.ndarray:
    x, y, z = at.T
    upper = (z > 8) & (z < 46) & (y < -66) & (abs(x) < 52)
    return upper | ((z < -74) & (z > -92) & (y < -70) & (abs(x) < 18))


@dataclass(frozen=True, eq=False)
class MeasuredSubject:
    """A head: ``vertices`` (n, 3) mm, ``triangles`` (m, 3), ``landmarks``, and what of it counts.

    ``seen`` maps places on the mean head (k, 3) mm to (k,) bool: whether this head shows its own skin there;
    ``shoulders``: whether it goes down to them.
    """

    name: str
    share: float
    vertices: np.ndarray
    triangles: np.ndarray
    landmarks: dict[str, np.ndarray]
    eyes_open: bool = True
    seen: Callable[[np.ndarray], np.ndarray] = _everything
    shoulders: bool = False


def _landmarks(path: Path) -> dict[str, np.ndarray]:
    return {k: np.array(v, float) for k, v in json.loads(path.read_text())["landmarks"].items()}


def first_head(folder: Path) -> MeasuredSubject:
    """The ICT mean head, origin midway between the tragia: the layout is first placed on it."""
    mesh = read_ply(folder / "ict" / "neutral.ply")
    found = _landmarks(folder / "ict" / "neutral.landmarks.json")
    origin = 0.5 * (found["t_l"] + found["t_r"])
    name = "ict_neutral"
    return MeasuredSubject(
        name,
        SHARES[name],
        mesh.vertices - origin,
        mesh.triangles,
        {k: p - origin for k, p in found.items()},
        shoulders=True,
    )


def _makehuman(folder: Path) -> Iterator[MeasuredSubject]:
    """The landmarks sit at the same places of the triangles that all share."""
    with np.load(folder / "makehuman" / "mh_heads.npz") as file:
        triangles, base = file["F"], file["base"].astype(float)
        heads = {name: file[name].astype(float) for name in SHARES if name in file.files}
    measured = MeasuredHead(base, triangles)
    points = measured.controls(list(_MAKEHUMAN.values()))
    spots = {}
    for name, p in zip(_MAKEHUMAN, points, strict=True):
        both = {name: p * [0, 1, 1]} if abs(p[0]) < 1 else {name + "_l": p, name + "_r": p * [-1, 1, 1]}
        for key, at in both.items():
            near = measured.surface.closest(at[None])
            corners = measured.surface.vertices[measured.surface.triangles[near.triangle[0]]]
            index = [int(np.argmin(((base - c) ** 2).sum(axis=1))) for c in corners]
            spots[key] = (index, near.weights[0])
    for name, vertices in heads.items():
        found = {k: w @ vertices[i] for k, (i, w) in spots.items()}
        yield MeasuredSubject(name, SHARES[name], vertices, triangles, found)


def heads(folder: Path) -> Iterator[MeasuredSubject]:
    """All heads of the folder."""
    yield first_head(folder)
    for name in ("s1", "s2", "s3"):
        with np.load(folder / "ict" / "examples" / f"{name}_base.npz") as file:
            vertices, triangles = file["V"].astype(float), file["F"]
        found = _landmarks(folder / "ict" / "examples" / f"{name}_truth.json")
        yield MeasuredSubject(f"ict_{name}", SHARES[f"ict_{name}"], vertices, triangles, found)
    for name, eyes_open, seen, shoulders in (
        ("lps_infinite", False, _everything, True),
        ("menpo_james", True, _without_hair, False),
        ("fran_cyberware", True, _without_smile, False),
    ):
        scan = read_ply(folder / "scans" / f"{name}.ply")
        found = _landmarks(folder / "scans" / f"{name}.landmarks.json")
        if not eyes_open:
            found = {k: p for k, p in found.items() if not k.startswith(("ps", "pi"))}
        if name == "fran_cyberware":
            found = {k: p for k, p in found.items() if not k.startswith(("ch", "al", "prn", "sn", "ls", "li", "sto"))}
        yield MeasuredSubject(name, SHARES[name], scan.vertices, scan.triangles, found, eyes_open, seen, shoulders)
    yield from _makehuman(folder)
