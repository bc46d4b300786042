# SPDX-License-Identifier: GPL-3.0-or-later
"""What the skin answers to, as plain numbers: a `Control` with all that moves no skin by itself left out."""

from functools import cache

import numpy as np

from ..acting.pose import GAZE_REACH
from ..tissue.muscle_field import JAW_MUSCLES, LIPS, base_name
from ..tissue.structures import Control

#: Inputs besides muscles. Muscles of the jaw act through its three, lids through theirs; the centres of the lips'
#: sphincters move skin only as far as these contract, so that their product is the input.
OTHERS = (
    *("jaw_open", "jaw_forward", "jaw_side"),
    *("lid_upper_l", "lid_lower_l", "lid_upper_r", "lid_lower_r"),
    *("gaze_l_x", "gaze_l_z", "gaze_r_x", "gaze_r_z"),
    *("lip_upper_forward", "lip_lower_forward", "seal", "cheeks"),
)
#: Where in `OTHERS` the two centres are.
CENTRES = (OTHERS.index("lip_upper_forward"), OTHERS.index("lip_lower_forward"))


@cache
def pulling(muscle_names: tuple[str, ...]) -> tuple[str, ...]:
    """The muscles that act on skin."""
    return tuple(name for name in muscle_names if base_name(name) not in JAW_MUSCLES)


def input_names(muscle_names) -> tuple[str, ...]:
    """Names of the inputs of a head with these muscles: those that pull on skin, then `OTHERS`."""
    return (*pulling(muscle_names), *OTHERS)


@cache
def _places(muscle_names: tuple[str, ...]) -> tuple[np.ndarray, tuple[int | None, ...]]:
    """Where in a head's muscles those are that act on skin, and the lips' sphincters (None: it has none)."""
    place = {name: k for k, name in enumerate(muscle_names)}
    return np.array([place[name] for name in pulling(muscle_names)], int), tuple(place.get(name) for name in LIPS)


def inputs_of(muscle_names, control: Control) -> np.ndarray:
    """(p,) the inputs of `input_names`: 0 at rest, about 1 (or -1) at their limits."""
    skin, lips = _places(muscle_names)
    activations = np.asarray(control.activations, float)
    centres = [0.0 if k is None else at * activations[k] for at, k in zip(control.lips, lips, strict=True)]
    gaze = [control.gaze_of(side) / GAZE_REACH for side in "lr"]
    jaw = np.clip(control.jaw, (0, -1, -1), 1)
    return np.concatenate(
        [activations[skin], jaw, np.ravel(control.lids), *gaze, centres, [control.seal, control.cheeks]]
    )
