# SPDX-License-Identifier: GPL-3.0-or-later
"""Adult norms: the mean of men's and women's measurements at 25 years, and a warp that brings a head toward them."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...sim.anatomy.head import SurfacePoints
from ...sim.anatomy.landmark_names import SKIN, mirrored
from ...sim.mesh_subdivision import drawn

TABLE = Path(__file__).resolve().parents[1] / "tables" / "measurements_25y.csv"

#: Not used to warp (still measured): skin fold and hairline decide them more than shape does.
LEFT_ALONE = (
    *("forehead_width", "subnasal_width", "forehead_height_I", "forehead_height_II"),
    *("physiognomical_face_height", "glabella_depth"),
)


@dataclass(frozen=True)
class Norm:
    """A distance between two landmarks: along x (``axis_x``), height (``axis_y``), depth (``axis_z``) or ``euclidean``.

    The axes are named as in the sources: y up, z forward. Without a side, two equal names are left and right.
    """

    name: str
    landmarks: tuple[str, str]
    kind: str
    mean: float
    sd: float

    def measure(self, positions: dict[str, np.ndarray]) -> float:
        """The distance in mm on landmarks name -> (3,) mm."""
        first, second = (positions[n] if n in positions else positions[n + "_l"] for n in self.landmarks)
        if self.landmarks[0] == self.landmarks[1]:
            second = positions[self.landmarks[1] + "_r"]
        gap = first - second
        axis = {"axis_x": 0, "axis_y": 2, "axis_z": 1}.get(self.kind)
        return float(np.linalg.norm(gap) if axis is None else abs(gap[axis]))

    def score(self, positions: dict[str, np.ndarray]) -> float:
        """How many standard deviations above the norm."""
        return (self.measure(positions) - self.mean) / self.sd


def norms() -> tuple[Norm, ...]:
    """All measurements of the table (sources there)."""
    with open(TABLE, newline="") as file:
        return tuple(
            Norm(r["measurement"], tuple(r["landmarks"].split("-")), r["type"], float(r["mean_mm"]), float(r["sd_mm"]))
            for r in csv.DictReader(file)
        )


def _kernel(a, b):
    """Prior covariance of displacements: 1.3 mm over 30 mm, 8 mm over 140 mm (whole-head growth)."""
    squared = ((a[:, None] - b[None]) ** 2).sum(-1)
    return 1.3**2 * np.exp(-squared / (2 * 30.0**2)) + 8.0**2 * np.exp(-squared / (2 * 140.0**2))


def toward_norms(faces: np.ndarray, vertices: np.ndarray, landmarks: SurfacePoints, rounds: int = 6) -> np.ndarray:
    """(n, 3) mm: the smoothest symmetric change of a head that brings its measurements within their usual spread.

    The measurements are those of the surface drawn of the mesh (``faces`` (m, 4), ``vertices`` (n, 3) mm).

    Gauss-Newton on the sum of squared scores with a Gaussian process prior on the landmarks' displacements.
    """
    found = landmarks.on({"skin": drawn(faces, vertices)})
    at = np.array([found[n] for n in SKIN])
    partner = [SKIN.index(mirrored(n)) for n in SKIN]
    used = [n for n in norms() if n.name not in LEFT_ALONE]
    prior = np.kron(_kernel(at, at) + 1e-3 * np.eye(len(at)), np.eye(3))
    move = np.zeros_like(at)

    def scores(shift):
        positions = dict(zip(SKIN, at + shift, strict=True))
        return np.array([n.score(positions) for n in used])

    for _ in range(rounds):
        now = scores(move)
        slope = np.empty((len(used), move.size))
        for k in range(move.size):
            nudged = move.copy().reshape(-1)
            nudged[k] += 1e-4
            slope[:, k] = (scores(nudged.reshape(-1, 3)) - now) / 1e-4
        gain = slope @ prior @ slope.T + np.eye(len(used))
        move = (prior @ slope.T @ np.linalg.solve(gain, slope @ move.reshape(-1) - now)).reshape(-1, 3)
        move = 0.5 * (move + move[partner] * [-1, 1, 1])
    weights = np.linalg.solve(_kernel(at, at) + 1e-3 * np.eye(len(at)), move)
    return vertices + _kernel(vertices, at) @ weights
