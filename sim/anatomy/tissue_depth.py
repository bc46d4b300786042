# SPDX-License-Identifier: GPL-3.0-or-later
"""How thick the soft tissue is over the bone, and how bone follows when that changes (Kähler 2002, 5.2, item 2).

The means and deviations of adults stand in ``assets/tables/tissue_depth.csv``, each row with its source.
"""

import csv
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .landmark_names import SKIN_OF_SKULL, SKULL

TABLE = Path(__file__).resolve().parents[2] / "assets" / "tables" / "tissue_depth.csv"


class Depth(NamedTuple):
    """Tissue depth over one skull landmark, mm: ``mean`` and standard deviation ``sd`` of adults."""

    mean: float
    sd: float


@cache
def table() -> dict[str, Depth]:
    """Landmark without its side -> depth: the 22 of the skull and a few more (``gn pr id``) that shape it."""
    with open(TABLE, encoding="utf-8", newline="") as file:
        return {row["landmark"]: Depth(float(row["mean_mm"]), float(row["sd_mm"])) for row in csv.DictReader(file)}


def depths() -> dict[str, Depth]:
    """Each of the 22 skull landmarks -> its depth."""
    return {name: table()[name.removesuffix("_l").removesuffix("_r")] for name in SKULL}


def skin_counterparts(landmarks: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Skull landmark -> (3,) mm, the point at the skin it is tied to.

    A skin landmark for all but ``rhi``, which is tied to the nasal bridge halfway from ``se`` to ``prn``. Skull
    landmarks whose skin landmark is not given are left out.
    """
    found = {name: np.asarray(landmarks[skin], float) for name, skin in SKIN_OF_SKULL.items() if skin in landmarks}
    if "se" in landmarks and "prn" in landmarks:
        found["rhi"] = (np.asarray(landmarks["se"], float) + np.asarray(landmarks["prn"], float)) / 2
    return {name: found[name] for name in SKULL if name in found}


def tissue_vectors(landmarks: dict[str, np.ndarray], skull_landmarks: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Skull landmark -> (3,) mm, the vector from the bone to the skin."""
    skin = skin_counterparts(landmarks)
    return {name: skin[name] - np.asarray(skull_landmarks[name], float) for name in skin if name in skull_landmarks}


def skull_targets(
    landmarks: dict[str, np.ndarray], vectors: dict[str, np.ndarray], scale: float | dict[str, float] = 1.0
) -> dict[str, np.ndarray]:
    """Skull landmark -> (3,) mm: where the bone belongs under other skin, or under thicker or thinner tissue.

    The skin's landmarks moved along the negated tissue vectors (Kähler 2002, 5.2, item 2); the warp from the current
    skull landmarks to these moves the skull.

    Parameters
    ----------
    landmarks : skin landmark -> (3,) mm
    vectors : skull landmark -> (3,) mm from bone to skin, see `tissue_vectors`
    scale : factor on the length of all vectors, or skull landmark -> factor (1 where not named)
    """
    skin = skin_counterparts(landmarks)
    factor = scale if isinstance(scale, dict) else dict.fromkeys(vectors, scale)
    known = {name: np.asarray(v, float) for name, v in vectors.items() if name in skin}
    return {name: skin[name] - factor.get(name, 1.0) * v for name, v in known.items()}
