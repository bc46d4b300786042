# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a rig and its shape keys are from the simulation on poses that they have never seen."""

import numpy as np

from ..acting import arkit, expressions
from ..acting.pose import Pose, control, pose_from
from ..progress import Progress, Work, portion
from ..tissue.muscle_field import JAW_MUSCLES, base_name
from ..tissue.solver import solve
from ..tissue.structures import Model
from .keys import Keys
from .mixtures import within
from .rig import Rig

#: The simulation counts as converged with steps under this, mm, or after so many of them.
TOLERANCE, ITERATIONS = 0.002, 300
#: Kinds of poses that are drawn at random.
KINDS = ("one", "three", "all", "three_jaw", "all_jaw", "shapes", "between")


def unseen_poses(muscle_names, kind: str, count: int, rng: np.random.Generator) -> list[Pose]:
    """``count`` poses of one, three or all muscles at random, with the jaw anywhere in its range if the kind says so; of two
    to four ARKit shapes on top of each other (``shapes``), between two expressions and rest (``between``), both at any
    strength; or all poses of a table: ``expressions``, ``arkit``."""
    tables = {"expressions": expressions.expressions, "arkit": arkit.poses}
    if kind in tables:
        return [expressions.for_head(pose, muscle_names) for pose in tables[kind]().values()]
    if kind in ("shapes", "between"):
        rows = unseen_poses(muscle_names, "arkit" if kind == "shapes" else "expressions", 0, rng)
        return [_overlaid(rows, kind, rng) for _ in range(count)]
    names = [name for name in muscle_names if base_name(name) not in JAW_MUSCLES]
    many = {"one": 1, "three": 3, "all": len(names)}[kind.partition("_")[0]]
    out = []
    for _ in range(count):
        values = {names[k]: rng.uniform() for k in rng.choice(len(names), many, replace=False)}
        if kind.endswith("_jaw"):
            values |= {"jaw_open": rng.uniform(), "jaw_forward": rng.uniform(-1, 1), "jaw_side": rng.uniform(-1, 1)}
        out.append(pose_from(values))
    return out


def _overlaid(rows, kind, rng) -> Pose:
    chosen = rng.choice(len(rows), rng.integers(2, 5) if kind == "shapes" else 2, replace=False)
    share = rng.uniform(size=len(chosen)) if kind == "shapes" else rng.uniform(0.2, 1) * rng.dirichlet((1, 1))
    total: dict[str, float] = {}
    for k, weight in zip(chosen, share, strict=True):
        for name, value in rows[k].values().items():
            total[name] = total.get(name, 0.0) + weight * value
    return within(total)


def errors(model: Model, poses, *plays) -> Work:
    """(len(plays), f, n) mm between the skin that each of ``plays`` makes of a pose and its control, (n, 3) mm, and the
    converged simulation's."""
    out = np.empty((len(plays), len(poses), model.count))
    for number, pose in enumerate(poses):
        yield Progress(number / len(poses), f"Simulating unseen pose {number + 1} of {len(poses)}")
        asked = control(model, pose)
        truth = solve(model, asked, max_iterations=ITERATIONS, tolerance=TOLERANCE).state.skin
        out[:, number] = [np.linalg.norm(play(pose, asked) - truth, axis=1) for play in plays]
    return out


def plays_of(rig: Rig, keys: Keys | None = None):
    """What `errors` compares: the rig, and its shape keys if there are any."""
    found = [lambda pose, asked: rig.skin(asked)]
    if keys is not None:
        found.append(lambda pose, asked: rig.frame.rest + keys.displacement("skin", pose.values()))
    return found


def summary(off: np.ndarray) -> dict[str, float]:
    """rms_mm over all vertices and poses, of the middle and of the worst pose; p95_mm and max_mm of single vertices."""
    each = np.sqrt((off**2).mean(axis=1))
    found = {
        "rms_mm": np.sqrt((off**2).mean()),
        "median_pose_rms_mm": np.median(each),
        "worst_pose_rms_mm": each.max(),
        "p95_mm": np.percentile(off, 95),
        "max_mm": off.max(),
    }
    return {"poses": len(off), **{name: round(float(value), 4) for name, value in found.items()}}


def measured(
    rig: Rig,
    model: Model,
    kinds=(*KINDS, "expressions", "arkit"),
    count: int = 8,
    seed: int = 1,
    keys: Keys | None = None,
) -> Work:
    """Kind of pose -> `summary` of the rig, with that of its shape keys as ``keys`` if they are given; ``count`` poses of
    every kind that is drawn at random. None is a sample but rows of a table that are one channel alone."""
    report = {}
    for number, kind in enumerate(kinds):
        poses = unseen_poses(model.muscle_names, kind, count, np.random.default_rng([seed, number]))
        start, stop = number / len(kinds), (number + 1) / len(kinds)
        off = yield from portion(errors(model, poses, *plays_of(rig, keys)), start, stop)
        report[kind] = summary(off[0]) | ({"keys": summary(off[1])} if keys else {})
    return report
