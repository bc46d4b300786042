# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses to learn from: every channel alone, then mixtures of few and many, with the jaw, lids, gaze and lips in any place.

Left eye, right eye and mouth hardly meet, so a mixture draws each of them anew: one solve teaches about all three.
"""

from dataclasses import dataclass

import numpy as np

from ..acting.pose import CONTROLS, Pose, control, pose_from
from ..progress import Progress, Work
from ..tissue.muscle_field import JAW_MUSCLES, LIPS, base_name
from ..tissue.solver import solve
from ..tissue.structures import Model
from .inputs import input_names, inputs_of
from .spending import progress_of

#: Channels that go below 0.
SIGNED = ("jaw_forward", "jaw_side", "gaze_x", "gaze_z", "gaze_l_x", "gaze_l_z", "gaze_r_x", "gaze_r_z")
SIGNED += ("lip_upper_forward", "lip_lower_forward", "cheek_puff")
#: Mixtures by how carefully a head is sampled.
COUNTS = {"quick": 250, "normal": 800, "fine": 2000}
#: Solver iterations at most, and the step (mm) at which a sample counts as at rest: 0.02 mm rms from it on average. A few
#: poses need many; given up early they would lie whole millimetres off.
ITERATIONS, TOLERANCE = 150, 0.05

_EYES = ("frontalis", "corrugator", "lateral_corrugator", "depressor_supercilii", "procerus", "orbicularis_oculi")
_EYES += ("levator_palpebrae", "auricularis", "occipitalis")
#: How often a mixture uses every muscle of a place at once, a control at all, the jaw open, and each sphincter of the
#: lips and its centre: what lips do against each other and the teeth is the hardest to learn.
_CROWD, _OFTEN, _OPEN, _LIPS = 0.15, 0.3, 0.55, 0.45
#: How often both sides do the same, as they do in most expressions.
_ALIKE = 0.35
#: Channels drawn a little beyond their end and clipped, so that the end itself is seen often.
_BEYOND = 1.15


@dataclass(frozen=True, eq=False)
class Samples:
    """s poses as the simulation rests in them. muscles: names of the k that pull on skin; inputs (s, k + o) as `inputs`
    has them; jaw (s, 3); skin (s, n, 3) mm; progress, left (s, k) as `spending` has them."""

    muscles: tuple[str, ...]
    inputs: np.ndarray
    jaw: np.ndarray
    skin: np.ndarray
    progress: np.ndarray
    left: np.ndarray


def channels(muscle_names) -> tuple[str, ...]:
    """Channels of a pose that move skin."""
    return (*muscle_names, *(name for name in CONTROLS if name != "tongue_out"))


def single_poses(muscle_names) -> list[Pose]:
    """Every channel alone at its ends, muscles of the jaw left out (they are the jaw's own channels); what works through
    another together with that: centres of the lips with the lips' sphincters, lips held together over a jaw open a little."""
    beside = {"lips_together": {"jaw_open": 0.4}}
    for name, sphincter in (("lip_upper_forward", "upper"), ("lip_lower_forward", "lower")):
        beside[name] = {f"orbicularis_oris_{sphincter}": 1.0}
    out = []
    for name in channels(muscle_names):
        if base_name(name) in JAW_MUSCLES:
            continue
        for value in (1.0, -1.0) if name in SIGNED else (1.0,):
            also = {k: v for k, v in beside.get(name, {}).items() if k in muscle_names or k in CONTROLS}
            out.append(pose_from({name: value, **also}))
    return out


def mixed_pose(muscle_names, rng: np.random.Generator) -> Pose:
    """A pose drawn at random: in each place a few muscles or all of them, and some of the controls."""
    values: dict[str, float] = {}
    for place in _places(muscle_names):
        few = min(len(place), 1 + rng.geometric(0.25)) if rng.uniform() > _CROWD else len(place)
        for k in rng.choice(len(place), few, replace=False) if place else ():
            values[place[k]] = min(rng.uniform(0, _BEYOND), 1.0)
    for sphincter, centre in zip(LIPS, ("lip_upper_forward", "lip_lower_forward"), strict=True):
        if rng.uniform() < _LIPS and sphincter in muscle_names:
            values[sphincter] = min(rng.uniform(0.1, _BEYOND), 1.0)
        if rng.uniform() < _LIPS:
            values[centre] = float(np.clip(rng.uniform(-_BEYOND, _BEYOND), -1, 1))
    if rng.uniform() < _OPEN:
        values["jaw_open"] = min(rng.uniform(0, 1.05), 1.0)
    for name in channels(muscle_names)[len(muscle_names) :]:
        if name.startswith(("jaw_open", "lip_")) or rng.uniform() > _OFTEN:
            continue
        low = -_BEYOND if name in SIGNED else 0.0
        values[name] = float(np.clip(rng.uniform(low, _BEYOND), -1, 1))
    if rng.uniform() < _ALIKE:
        values = {name: value for name, value in values.items() if not name.endswith("_r")}
        values |= {name[:-2] + "_r": value for name, value in values.items() if name.endswith("_l")}
    return pose_from(values)


def _places(muscle_names) -> list[list[str]]:
    out: list[list[str]] = [[], [], []]
    for name in muscle_names:
        if base_name(name) not in JAW_MUSCLES:
            out[(1 if name.endswith("_r") else 0) if name.startswith(_EYES) else 2].append(name)
    return out


def drawn_poses(muscle_names, count: int, rng: np.random.Generator) -> list[Pose]:
    """The single poses and ``count`` mixtures."""
    return single_poses(muscle_names) + [mixed_pose(muscle_names, rng) for _ in range(count)]


def sampled(model: Model, poses, *, max_iterations: int = ITERATIONS, tolerance: float = TOLERANCE) -> Work:
    """Simulate ``poses``, each from rest; returns `Samples`."""
    names = model.muscle_names
    pulling = input_names(names)
    k = sum(base_name(name) not in JAW_MUSCLES for name in names)
    size = len(poses)
    out = Samples(
        pulling[:k],
        np.empty((size, len(pulling))),
        np.empty((size, 3)),
        np.empty((size, model.count, 3), np.float32),
        np.empty((size, k)),
        np.empty((size, k)),
    )
    for number, pose in enumerate(poses):
        yield Progress(number / size, f"Simulating pose {number + 1} of {size}")
        asked = control(model, pose)
        state = solve(model, asked, max_iterations=max_iterations, tolerance=tolerance).state
        out.inputs[number], out.jaw[number], out.skin[number] = inputs_of(names, asked), asked.jaw, state.skin
        out.progress[number], out.left[number] = progress_of(model, asked, state)
    return out
