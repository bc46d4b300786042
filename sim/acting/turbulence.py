# SPDX-License-Identifier: GPL-3.0-or-later
"""Gusts: a random velocity field without sources, the sum of few waves (Kraichnan 1970, Physics of Fluids 13, 22).

Each wave is an eddy size and a rate at which such eddies pass, drawn evenly over their octaves, and moves air across its own
direction only, so that no air is made or lost. The rates stay below what films can show and faces can follow.
"""

import numpy as np

#: mm from crest to crest, and passes per second.
SIZES = (100.0, 1000.0)
RATES = (0.3, 6.0)
WAVES = 24


class Turbulence:
    """A field drawn from ``rng``; its fluctuation in each direction is 1 root mean square."""

    def __init__(self, rng: np.random.Generator):
        def direction():
            v = rng.normal(size=(WAVES, 3))
            return v / np.linalg.norm(v, axis=1, keepdims=True)

        along = direction()
        size, rate = (np.exp(rng.uniform(*np.log(limits), WAVES)) for limits in (SIZES, RATES))
        self._wave = 2 * np.pi / size[:, None] * along
        self._rate = 2 * np.pi * rate
        across = np.cross(along, direction())
        across *= np.sqrt(3.0) / np.linalg.norm(across, axis=1, keepdims=True)
        self._across = across * np.sqrt(2 / WAVES)
        self._phase = rng.uniform(0, 2 * np.pi, WAVES)

    def at(self, points: np.ndarray, time: float) -> np.ndarray:
        """(n, 3): the fluctuation at ``points`` (n, 3) mm and ``time`` s."""
        return np.cos(points @ self._wave.T + self._rate * time + self._phase) @ self._across


def gusty(wind: np.ndarray, strength, points: np.ndarray, times, seed: int = 0) -> np.ndarray:
    """(k, n, 3) mm/s: winds (k, 3) that fluctuate by ``strength`` (k,) of their speed (root mean square), at ``points``
    (n, 3) mm and ``times`` (k,) s; the same for the same ``seed``."""
    field = Turbulence(np.random.default_rng(seed))
    swing = np.asarray(strength, float) * np.linalg.norm(wind, axis=1)
    return np.stack([w + s * field.at(points, t) for w, s, t in zip(wind, swing, times, strict=True)])
