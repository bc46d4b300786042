# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses that the rig plays so that shape keys can be fitted to them: every slider alone on its way, a few, many,
expressions as artists compose them, and eyes looking anywhere under lids anywhere."""

import numpy as np

from ..acting.pose import Pose, control, pose_from
from ..progress import Progress, Work
from ..tissue.muscle_field import JAW_MUSCLES, base_name
from ..tissue.posing import posed_parts
from .actor import Actor
from .mixtures import SIGNED, composed_pose, look, mixed_pose
from .quantities import sliders

#: How far each slider is moved alone, besides 1; how many poses of a few sliders, of many, composed ones, and looks.
_WAY = (0.08, 0.25, 0.5, 0.75, -0.3, -0.65, -1.0)
_FEW, _MANY, _COMPOSED, _LOOKS = 700, 400, 1500, 200
#: Every so many of these, all muscles at once.
_CROWD = 4


def played_poses(
    actor: Actor, rng: np.random.Generator, few=_FEW, many=_MANY, composed=_COMPOSED, looks=_LOOKS
) -> list[dict[str, float]]:
    """Channel values of each pose: every slider alone at 1, then on its way, then mixtures, composed expressions and looks;
    so many of each."""
    names = sliders(actor.rig)
    poses = [{name: 1.0} for name in names]
    poses += [{name: value} for name in names for value in _WAY if value > 0 or name in SIGNED]
    for number in range(few):
        pose = _some(names, rng.integers(2, 7), rng)
        if number % 2:  # both sides alike
            pose |= {name[:-2] + "_r": value for name, value in pose.items() if name.endswith("_l")}
        poses.append(pose)
    for number in range(many):
        pose = _some(names[: len(actor.muscle_names)], len(actor.muscle_names), rng) if number % _CROWD == 0 else {}
        pose |= mixed_pose(actor.muscle_names, rng).values()
        jaw = [name for name in actor.muscle_names if base_name(name) in JAW_MUSCLES]
        poses.append(pose | _some(jaw, rng.integers(0, 3), rng))
    poses += [composed_pose(actor.muscle_names, rng).values() for _ in range(composed)]
    return poses + [look(rng) for _ in range(looks)]


def _some(names, count: int, rng: np.random.Generator) -> dict[str, float]:
    chosen = rng.choice(len(names), count, replace=False)
    return {names[k]: rng.uniform(-1 if names[k] in SIGNED else 0, 1) for k in chosen}


def played_parts(actor: Actor, poses) -> Work:
    """Part -> displacements from rest (f, n, 3) mm, float32, of the parts that move."""
    rest = posed_parts(actor, actor.rest_state(), control(actor, Pose()))
    out = {part: np.empty((len(poses), *points.shape), np.float32) for part, points in rest.items()}
    for number, values in enumerate(poses):
        if number % 20 == 0:
            yield Progress(number / len(poses), "Playing poses")
        asked = control(actor, pose_from(values))
        for part, points in posed_parts(actor, actor.state(asked), asked).items():
            out[part][number] = points - rest[part]
    return {part: motion for part, motion in out.items() if np.abs(motion).max(initial=0.0) > 1e-3}
