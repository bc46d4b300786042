# SPDX-License-Identifier: GPL-3.0-or-later
"""What all benchmarks of the tissue act, how they take time, and how a model is made stiffer."""

import time
from dataclasses import replace

import numpy as np

from headshop.sim.acting.head_motion import HeadMotion, felt, rotation
from headshop.sim.acting.performance import sample_performance
from headshop.sim.acting.pose import control
from headshop.sim.tissue.lee1995.constants import DEFAULT as LEE

FPS = 24.0
FRAME = 1 / FPS
START = 0.5  # s into the sample's smile: the left side is under way
#: The constants of the model of 1995 that are stiffnesses.
_LEE = (
    *("epidermis", "dermal_fatty", "dermal_fatty_stiff", "fascia", "muscle_layer"),
    *("volume", "shape", "restoration"),
)


def clip(model, frames: int, shaken: bool = False) -> list:
    """Controls of ``frames`` frames of the sample's smile; ``shaken``: while the head nods, turns and bounces."""
    acted = sample_performance()
    controls = [control(model, acted.pose(START + k * FRAME)) for k in range(frames)]
    if shaken:
        controls = [replace(c, around=f) for c, f in zip(controls, felt(shake(frames)), strict=True)]
    return controls


def shake(frames: int) -> HeadMotion:
    """A head that turns by 20 degrees twice a second, nods by 11 and bounces by 25 mm."""
    t = np.arange(frames) * FRAME
    turns = np.array([rotation(0.35 * np.sin(4 * np.pi * x), 0.2 * np.sin(3 * np.pi * x), 0.0) for x in t])
    return HeadMotion(turns, np.outer(np.sin(2.6 * np.pi * t), [10.0, 0.0, 25.0]), FPS)


def stiffer(model, factor: float):
    """A model whose forces are ``factor`` times as large against its masses; for those with a `dynamic_scale`."""
    parameters = replace(model.parameters, dynamic_scale=factor * model.parameters.dynamic_scale)
    # the matrix at rest stays; what was factorised with masses does not
    kept = {key: value for key, value in getattr(model, "cache", {}).items() if key == "matrix"}
    return replace(model, parameters=parameters, **({"cache": kept} if hasattr(model, "cache") else {}))


def stiffer_lee(factor: float):
    """The constants of 1995 with every stiffness ``factor`` times as large."""
    return replace(LEE, **{name: factor * getattr(LEE, name) for name in _LEE})


class Clock:
    """Processor seconds (of all threads) and elapsed seconds of a ``with`` block."""

    def __enter__(self):
        self._begin, self._busy = time.perf_counter(), time.process_time()
        return self

    def __exit__(self, *_):
        self.elapsed, self.cpu = time.perf_counter() - self._begin, time.process_time() - self._busy


def root_mean_square(one, other) -> float:
    """mm between points (..., n, 3)."""
    return float(np.sqrt(((np.asarray(one) - other) ** 2).sum(axis=-1).mean()))
