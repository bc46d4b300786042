# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the vertices of the reference skin are: our own mean head, measured once and kept in ``assets/tables``."""

from pathlib import Path

import numpy as np

from .skin_layout import BLOCKS, skin_layout

#: (k, 3) float32 mm for the left side and the midline of the layout; sources are named in the file.
MEAN_HEAD = Path(__file__).resolve().parents[1] / "tables" / "mean_head.npz"


def both_sides(left: np.ndarray) -> np.ndarray:
    """(n, 3) mm of all vertices, exactly symmetric, from those of the left side and the midline."""
    layout = skin_layout()
    out = np.empty((layout.count, 3))
    out[layout.mirror[layout.left]] = left * [-1, 1, 1]
    out[layout.left] = left
    out[layout.midline, 0] = 0
    return out


def mean_shape() -> np.ndarray:
    """(n, 3) mm, the mean of the heads measured; `skin_finish.finish_shape` makes the reference skin of it.

    The late ring of the mouth, which no scan shows, is put half way between its neighbours.
    """
    layout = skin_layout()
    with np.load(MEAN_HEAD) as file:
        known = file["left"].astype(np.float64)
    left = np.zeros((len(layout.left), 3))
    left[: len(known)] = known[: len(left)]
    x = both_sides(left)
    ring, late = layout.rings["mouth"], BLOCKS["mouth"].late
    x[ring[late]] = 0.5 * (x[ring[late - 1]] + x[ring[late + 1]])
    return x


def landmark_seeds() -> dict[str, np.ndarray]:
    """Landmark without side -> (3,) mm, left side: where the mean of the heads measured has it."""
    with np.load(MEAN_HEAD) as file:
        return {str(name): at.astype(np.float64) for name, at in zip(file["seed_names"], file["seeds"], strict=True)}
