# SPDX-License-Identifier: GPL-3.0-or-later
"""Several muscles on the same skin (Waters 1986, 4.8, figure 34).

Where zones overlap, z(C) = z(A) and z(B), the resultant F[p(C)] = F[p(A)] + F[p(B)] is found before anything is
displaced: the sum of the vectors by the parallelogram law, whatever their order.
"""

import numpy as np


def resultant(points: np.ndarray, muscles, tensions) -> np.ndarray:
    """(n, 3) mm: the sum of what ``muscles`` at ``tensions`` (0..1) do to ``points`` (n, 3), all at rest.

    muscles : `linear.LinearMuscle`, `sphincter.Sphincter` and `sheet.SheetMuscle` in any number and order
    """
    total = np.zeros_like(points, dtype=float)
    for muscle, tension in zip(muscles, tensions, strict=True):
        if tension:
            total += muscle.displacement(points, tension)
    return total


def contracted(points: np.ndarray, muscles, tensions) -> np.ndarray:
    """(n, 3) mm: where ``points`` (n, 3) of any mesh lie when ``muscles`` contract; see `resultant`."""
    return points + resultant(points, muscles, tensions)


def sharing(lengths, squares, tensions: np.ndarray) -> np.ndarray:
    """(n,) by how much less than their sum muscles move skin that they pull together.

    "Every muscle has a limit to its length or range of contraction" (4.8) and the thesis leaves open which. Here skin goes
    half way, as a geometric mean, between the sum and the root of the sum of squares. One muscle alone is not held back,
    and neither is any by others that hardly reach the same skin.

    lengths, squares : (n, k), sparse or not, mm that each muscle moves the skin by at full contraction, and mm²;
    tensions (k,)
    """
    total = lengths @ tensions
    share = np.sqrt(squares @ tensions**2) / np.where(total > 0, total, 1.0)
    return np.where(total > 0, np.sqrt(share), 1.0)


def common_zone(points: np.ndarray, muscles) -> np.ndarray:
    """(n,) bool: the points that lie in the zone of more than one of ``muscles``."""
    return np.sum([muscle.influence(points) > 0 for muscle in muscles], axis=0) > 1
