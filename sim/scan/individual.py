# SPDX-License-Identifier: GPL-3.0-or-later
"""Make an individual of the reference head: measurements drawn from norms, the rest as smooth as can be.

Each measurement of ``assets/tables/face_variation.csv`` is a linear functional of a displacement field over the head.
Among all fields that change the measurements as drawn, the smoothest is taken: the mean of a Gaussian process
(Rasmussen and Williams 2006, equation 2.25). It is smooth everywhere, so no landmark shows.
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..adapt.follow import follow
from ..anatomy.head import Head
from ..progress import finish

TABLE = Path(__file__).resolve().parents[2] / "assets" / "tables" / "face_variation.csv"

#: Gaussian kernels of the field: reach in mm and share of the variance.
SCALES = ((80.0, 0.5), (38.0, 0.3), (18.0, 0.2))
#: All measurements of one person lean the same way: how much of each is the person's size.
SIZE_SHARE = 0.35
#: Measurements need not be met exactly, they contradict each other a little: fraction of the field's own deviation.
SLACK = 0.12
#: Left and right differ by about this much, mm, over patches of this reach.
ASYMMETRY, PATCH = 0.55, 32.0


@dataclass(frozen=True, eq=False)
class Field:
    """A smooth displacement: ``sources`` (s, 3) mm, ``strength`` (s, 3), and small patches of one kernel."""

    sources: np.ndarray
    strength: np.ndarray
    patches: np.ndarray
    patch_strength: np.ndarray

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Displacement (n, 3) mm at points (n, 3) mm."""
        points = np.asarray(points, dtype=float)
        apart = _squared(points, self.patches)
        return _kernel(points, self.sources) @ self.strength + np.exp(-apart / (2 * PATCH**2)) @ self.patch_strength


def draw_field(landmarks: dict[str, np.ndarray], rng: np.random.Generator, strength: float = 1.0) -> Field:
    """The field of one random woman or man; ``strength`` 1 is the variance of the norms, 0 the reference itself."""
    points, rows, deviations, sexes, of = _functionals(landmarks)
    draws = np.sqrt(1 - SIZE_SHARE) * rng.standard_normal(of.max() + 1) + np.sqrt(SIZE_SHARE) * rng.standard_normal()
    target = strength * np.clip(draws, -2.2, 2.2)[of] * deviations  # beyond, people look odd
    positions = np.array(list(landmarks.values()))
    patches = positions[rng.choice(len(positions), 14, replace=False)]
    uneven = strength * ASYMMETRY * rng.standard_normal(patches.shape)
    # The reference is the mean of both sexes, so either is half the difference away.
    target = target + strength * rng.choice([-0.5, 0.5]) * sexes
    return Field(points, smoothest(points, rows, target[:, None])[:, :, 0], patches, uneven)


def variation(landmarks: dict[str, np.ndarray], points: np.ndarray) -> np.ndarray:
    """(n, 3, m) mm: how ``points`` (n, 3) of the reference move for one standard deviation of each of the m independent
    draws of `draw_field`: one per measurement, the person's size, and the sex. Patches of asymmetry are left out."""
    sources, rows, deviations, sexes, of = _functionals(landmarks)
    draws = np.zeros((len(of), of.max() + 3))
    draws[np.arange(len(of)), of] = np.sqrt(1 - SIZE_SHARE) * deviations
    draws[:, -2] = np.sqrt(SIZE_SHARE) * deviations
    draws[:, -1] = 0.5 * sexes
    return displaced(points, sources, smoothest(sources, rows, draws))


def smoothest(sources: np.ndarray, rows: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """(p, 3, m) strengths at ``sources`` (p, 3) mm of the smoothest fields by which measurements ``rows`` (a, p, 3),
    `functionals`, change by ``changes`` (a, m) mm, as nearly as they agree."""
    kernel = _kernel(sources, sources)
    gram = sum(rows[:, :, k] @ kernel @ rows[:, :, k].T for k in range(3))
    weights = np.linalg.solve(gram + SLACK**2 * np.diag(np.diag(gram)), changes)
    return np.einsum("am,apk->pkm", weights, rows)


def displaced(points: np.ndarray, sources: np.ndarray, strength: np.ndarray) -> np.ndarray:
    """(n, 3, m) mm: how fields of that ``strength`` (p, 3, m) at ``sources`` (p, 3) mm move ``points`` (n, 3) mm."""
    return np.tensordot(_kernel(np.asarray(points, dtype=float), sources), strength, axes=1)


def individual(reference: Head, rng: np.random.Generator, strength: float = 1.0) -> Head:
    """A person: the skin of ``reference`` displaced by one random field, and all that lies under it following."""
    field = draw_field(reference.landmark_positions(), rng, strength)
    skin = reference.skin.vertices
    return finish(follow(reference, skin + field(skin))).head


def _squared(a, b):
    return np.maximum((a * a).sum(axis=1)[:, None] + (b * b).sum(axis=1) - 2 * a @ b.T, 0)


def _kernel(a, b):
    apart = _squared(a, b)
    return sum(share * np.exp(-apart / (2 * reach**2)) for reach, share in SCALES)


def _functionals(landmarks):
    """`functionals` of the `TABLE`, and (a,) mm each: deviations, and men's mean less women's; row of the table (a,)."""
    table = read_table(TABLE)
    points, rows, of = functionals(landmarks, table)
    deviations, sexes = (np.array([float(table[k][name]) for k in of]) for name in ("sd_mm", "sex_mm"))
    return points, rows, deviations, sexes, of


def read_table(path) -> list[dict[str, str]]:
    """Rows of a table of measurements, by column."""
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def functionals(landmarks: dict[str, np.ndarray], table) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The measurements of a ``table`` (`read_table`) on a head with these ``landmarks`` (name -> (3,) mm).

    Columns: ``at``, ``from`` : landmarks, the mean of those named, one joined of several by + being their middle; ``axis``
    in which the first lie beyond the second: x, y, z, one with a minus, ``along`` the line between them or ``out`` to the
    side. A row with * stands for both sides, which are alike.

    Returns points (p, 3) mm; (a, p, 3), what each measurement is of their places, so that its sum with displacements there is
    how it changes; and row of the table (a,).
    """
    points, index, rows, of = [], {}, [], []

    def at(text):
        """The indices of the points in ``text``: landmarks, or the middle of several joined by +."""
        found = []
        for name in text.split():
            if name not in index:
                index[name] = len(points)
                points.append(np.mean([landmarks[part] for part in name.split("+")], axis=0))
            found.append(index[name])
        return found

    for number, row in enumerate(table):
        both = "*" in row["at"] + row["from"]
        for side, sign in (("l", 1.0), ("r", -1.0)) if both else (("", 1.0),):
            ends = [at(row[end].replace("*", side)) for end in ("at", "from")]
            axis = row["axis"]
            if axis == "along":
                direction = np.mean([points[i] for i in ends[0]], axis=0) - np.mean(
                    [points[i] for i in ends[1]], axis=0
                )
                direction = direction / np.linalg.norm(direction)
            elif axis == "out":
                direction = np.array([sign, 0, 0])
            else:
                direction = (-1.0 if axis[0] == "-" else 1.0) * np.eye(3)["xyz".index(axis[-1])]
            rows.append((ends, direction))
            of.append(number)
    out = np.zeros((len(rows), len(points), 3))
    for k, (ends, direction) in enumerate(rows):
        for end, share in zip(ends, (1.0, -1.0), strict=True):
            for i in end:
                out[k, i] += share * direction / len(end)
    return np.array(points), out, np.array(of)
