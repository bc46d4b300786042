# SPDX-License-Identifier: GPL-3.0-or-later
"""A pose as an artist says it (muscles, jaw, lids, gaze) and what it asks of a model."""

import difflib
import math
import reprlib
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..errors import InputError
from ..tissue.structures import Control, Model

#: What one eye turns besides `gaze_x` and `gaze_z`; the centre of each lip's sphincter.
EYES = ("gaze_l_x", "gaze_l_z", "gaze_r_x", "gaze_r_z")
LIPS = ("lip_upper_forward", "lip_lower_forward")
#: The controls that are not muscles.
CONTROLS = (
    *("jaw_open", "jaw_forward", "jaw_side", "blink_l", "blink_r", "gaze_x", "gaze_z", *EYES),
    *(*LIPS, "lips_together", "cheek_puff", "tongue_out"),
)

#: What gaze 1.0 means, rad (Ekman, Friesen and Hager 2002, AU 61 to 64: eyes to the side 35, up or down 25 degrees).
GAZE_REACH = np.radians([35.0, 25.0])

#: Lid closure by a fully contracted muscle: share of the rest opening, (upper lid, lower lid).
LID_WORK = {
    "levator_palpebrae": (-0.32, 0.0),
    "orbicularis_oculi_palpebral": (0.22, 2.6),
    "orbicularis_oculi_lacrimal": (0.03, 0.1),
    "orbicularis_oculi_orbital": (0.12, 1.7),
    "corrugator": (0.08, 0.2),  # the brow's skin sinks on the lid
    "depressor_supercilii": (0.12, 0.2),
}
#: Jaw motion by fully contracted muscles of both sides: (open, forward); one side alone also moves the jaw sideways,
#: away from it. Closers pull against opening.
JAW_WORK = {
    "digastricus": (0.45, 0.0),
    "pterygoideus_lateralis": (0.15, 0.6),
    "masseter": (-0.5, 0.05),
    "temporalis": (-0.4, -0.05),
    "pterygoideus_medialis": (-0.3, 0.1),
}
SIDE_WORK = 0.6


@dataclass(frozen=True)
class Pose:
    """muscles: name -> 0..1; jaw_open 0..1, jaw_forward and jaw_side -1..1; blink 0..1; gaze -1..1 (left, up), of both eyes
    and of each besides; lips' sphincter centres -1..1 (back, forward); cheek_puff -1..1; lips_together and tongue_out 0..1.

    Raises
    ------
    InputError : the muscles are no dict.
    """

    muscles: dict[str, float] = field(default_factory=dict)
    jaw_open: float = 0.0
    jaw_forward: float = 0.0
    jaw_side: float = 0.0
    blink_l: float = 0.0
    blink_r: float = 0.0
    gaze_x: float = 0.0
    gaze_z: float = 0.0
    gaze_l_x: float = 0.0
    gaze_l_z: float = 0.0
    gaze_r_x: float = 0.0
    gaze_r_z: float = 0.0
    lip_upper_forward: float = 0.0
    lip_lower_forward: float = 0.0
    cheek_puff: float = 0.0
    lips_together: float = 0.0
    tongue_out: float = 0.0

    def __post_init__(self):
        if not isinstance(self.muscles, Mapping):
            raise InputError(
                'A pose has its muscles as a dict of names and contractions, such as {"zygomaticus_major_l": 1.0}, '
                f"not as {type(self.muscles).__name__}."
            )

    def values(self) -> dict[str, float]:
        """Channel name -> value: every muscle named, and all of `CONTROLS`."""
        return {**self.muscles, **{name: getattr(self, name) for name in CONTROLS}}


def pose_from(values: dict[str, float]) -> Pose:
    """The pose with channels ``values`` (muscle and control names mixed).

    Raises
    ------
    InputError : a value is not a finite number.
    """
    _require_numbers(values)
    muscles = {k: float(v) for k, v in values.items() if k not in CONTROLS}
    return Pose(muscles, **{k: float(v) for k, v in values.items() if k in CONTROLS})


def _require_numbers(values: Mapping[str, float]) -> None:
    for name, value in values.items():
        try:
            finite = math.isfinite(value)
        except (TypeError, ValueError, OverflowError):  # text, an array, a whole number beyond every float
            finite = False
        if not finite:
            raise InputError(f"The pose sets {name!r} to {reprlib.repr(value)}: give a finite number.")


def _no_muscle(name, known) -> str:
    """What to say of a muscle that is not among the ``known`` ones."""
    if name in CONTROLS:
        return f"{name!r} is a control, not a muscle: write Pose({name}=...), or pose_from with muscles and controls mixed."
    sides = [side for side in (f"{name}_l", f"{name}_r") if side in known]
    near = sides or difflib.get_close_matches(str(name).lower(), [*known, *CONTROLS], n=2, cutoff=0.7)
    meant = f" (did you mean {' or '.join(map(repr, near))}?)" if near else ""
    return f"The pose uses the muscle {name!r}, which this head does not have: correct the name{meant} or leave it out."


def combined(one: Pose, other: Pose) -> Pose:
    """Both poses at once: the sum of their channels."""
    total = dict(one.values())
    for name, value in other.values().items():
        total[name] = total.get(name, 0.0) + value
    return pose_from(total)


def control(model: Model, pose: Pose) -> Control:
    """The control of ``model`` for ``pose``. Values are clipped to their range.

    Raises
    ------
    InputError : what is given is no pose, names a muscle that the model does not have, or has a value that is not a finite
        number.
    """
    if not isinstance(pose, Pose):
        raise InputError(
            f"The pose is given as {type(pose).__name__}: give a Pose, or let pose_from make one of a dict of channels."
        )
    _require_numbers(pose.values())
    index = {name: k for k, name in enumerate(model.muscle_names)}
    activation = np.zeros(len(index))
    for name, value in pose.muscles.items():
        if name not in index:
            raise InputError(_no_muscle(name, index))
        activation[index[name]] = np.clip(value, 0.0, 1.0)

    def of(base, side):
        return activation[index[f"{base}_{side}"]] if f"{base}_{side}" in index else 0.0

    opening, forward, aside = float(pose.jaw_open), float(pose.jaw_forward), float(pose.jaw_side)
    closing = 0.0
    for base, (opens, ahead) in JAW_WORK.items():
        both = (of(base, "l") + of(base, "r")) / 2
        if opens > 0:
            opening += opens * both
        else:
            closing += opens * both
        forward += ahead * both
        if base == "pterygoideus_lateralis":
            aside += SIDE_WORK * (of(base, "r") - of(base, "l"))
    opening = np.clip(opening + closing * max(opening, 0.0), 0.0, 1.0)  # closers can only undo an opening
    lids = np.zeros((2, 2))
    for k, (side, blink) in enumerate((("l", pose.blink_l), ("r", pose.blink_r))):
        lids[k] = sum(of(base, side) * np.array(work) for base, work in LID_WORK.items())
        shut = float(np.clip(blink, 0, 1))
        lids[k] = lids[k] * (1 - shut) + shut
    gaze = np.clip([pose.gaze_x, pose.gaze_z], -1, 1)
    each = np.reshape([getattr(pose, name) for name in EYES], (2, 2))
    return Control(
        activations=activation,
        jaw=np.array([opening, np.clip(forward, -1, 1), np.clip(aside, -1, 1)]),
        lids=lids,
        gaze=gaze * GAZE_REACH,
        eyes=(np.clip(gaze + each, -1, 1) - gaze) * GAZE_REACH,
        lips=np.clip([getattr(pose, name) for name in LIPS], -1, 1),
        seal=float(np.clip(pose.lips_together, 0, 1)),
        tongue=float(np.clip(pose.tongue_out, 0, 1)),
        cheeks=float(np.clip(pose.cheek_puff, -1, 1)),
    )
