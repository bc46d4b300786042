# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses that nobody asks for, to try how much a model bears: muscles at random, the jaw and all else anywhere."""

import numpy as np

from .pose import CONTROLS, Pose

#: Controls that go below 0.
SIGNED = frozenset(
    name
    for name in CONTROLS
    if name.startswith(("jaw_forward", "jaw_side", "gaze", "lip_upper", "lip_lower")) or name == "cheek_puff"
)
_FEW = 0.15  # share of the muscles in a sparse pose
_USED, _END = 0.6, 0.25  # how often a control is used, and at an end of its range


def random_pose(muscle_names, rng: np.random.Generator) -> Pose:
    """Half of the time all muscles at once, evenly between 0 and 1; else few, now and then at their strongest.

    Jaw, lids, gaze, lips, cheeks and tongue lie anywhere in their ranges, a quarter of those used at an end.
    """
    count = len(muscle_names)
    value = rng.uniform(0, 1, count)
    if rng.uniform() < 0.5:
        value = np.where(rng.uniform(size=count) < 0.3, 1.0, value) * (rng.uniform(size=count) < _FEW)
    chosen = {}
    for name in CONTROLS:
        low = -1.0 if name in SIGNED else 0.0
        at = rng.uniform(low, 1.0)
        if rng.uniform() < _END:
            at = 1.0 if at > (low + 1) / 2 else low
        chosen[name] = float(at) if rng.uniform() < _USED else 0.0
    return Pose({name: float(v) for name, v in zip(muscle_names, value, strict=True) if v > 0}, **chosen)
