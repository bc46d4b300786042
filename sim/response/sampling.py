# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses to learn from, simulated: every channel alone, then mixtures (`mixtures`)."""

from dataclasses import dataclass

import numpy as np

from ..acting.pose import CONTROLS, Pose, control, pose_from
from ..progress import Progress, Work
from ..tissue.muscle_field import JAW_MUSCLES, base_name
from ..tissue.solver import solve
from ..tissue.structures import Model
from .inputs import input_names, inputs_of
from .mixtures import SIGNED, channels, composed_pose, crowded_pose, mixed_pose
from .spending import progress_of

#: Mixtures by how carefully a head is sampled.
COUNTS = {"quick": 350, "normal": 1460, "fine": 1660}
#: What mixtures are, by turns. All muscles at once fill a space of far more dimensions than what people do, so that they are
#: the most: with none of them a pose of all muscles is off by twice as much as with these.
_TURNS = (crowded_pose, mixed_pose, composed_pose, crowded_pose, composed_pose)
_TURNS += (crowded_pose, mixed_pose, composed_pose, crowded_pose)
#: Solver iterations at most, and the step (mm) at which a sample counts as at rest. Under the chin of a wide open mouth skin
#: goes on in small steps for whole millimetres: at 0.05 mm samples were given up as much as 10 mm from rest.
ITERATIONS, TOLERANCE = 200, 0.01


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


def drawn_poses(muscle_names, count: int, rng: np.random.Generator) -> list[Pose]:
    """The single poses and ``count`` mixtures: all muscles at once, some at random and composed expressions by turns."""
    return single_poses(muscle_names) + [_TURNS[k % len(_TURNS)](muscle_names, rng) for k in range(count)]


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
