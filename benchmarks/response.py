# SPDX-License-Identifier: GPL-3.0-or-later
"""The response rig of the shipped head: how long it takes to learn, poses a second beside a solve in the same run, errors.

    python benchmarks/response.py [--care normal] [--unseen 12]

Errors are against the converged simulation (contacts and all) on poses that were no samples: one, three or all muscles
at random, the same with the jaw anywhere in its range, ARKit shapes on top of each other, poses between two expressions,
all expressions and all ARKit shapes; of the rig and of the shape keys that are baked from it. Mixtures that the rig is
learnt from are composed of rows of the same tables, at other strengths; rows of one channel alone are samples.
Eyeballs: how deep the drawn lids sink into them, beyond rest, in the ARKit shapes and in looks to all sides under lids
that close.
Prints a table and, on the last line, the same as JSON.
"""

import argparse
import json
import time

import numpy as np

from headshop.sim.acting import arkit
from headshop.sim.acting.expressions import for_head
from headshop.sim.acting.pose import Pose, control
from headshop.sim.anatomy.storage import load_head
from headshop.sim.mesh_subdivision import smoother
from headshop.sim.progress import finish
from headshop.sim.response import accuracy, fit, keys, mirror, playing, sampling, storage
from headshop.sim.response.actor import actor_of
from headshop.sim.response.mixtures import SIGNED
from headshop.sim.response.quantities import sliders
from headshop.sim.tissue.eye_surface import eyeball_radius
from headshop.sim.tissue.model import build_model
from headshop.sim.tissue.solver import solve


def _clock(act, times: int) -> tuple[float, float]:
    """Median and least seconds of ``act(k)``, for k below ``times``."""
    taken = []
    for k in range(times):
        begin = time.perf_counter()
        act(k)
        taken.append(time.perf_counter() - begin)
    return float(np.median(taken)), min(taken)


def speed(rig, model, poses) -> dict:
    """Poses a second from control to skin, one by one and fifty at once; and of solves to rest from rest."""
    asked = [control(model, pose) for pose in poses]
    solver, _ = _clock(lambda k: solve(model, asked[k]), min(len(asked), 8))
    rig.skin(asked[0])
    median, least = _clock(lambda k: rig.skin(asked[k % len(asked)]), 400)
    used = time.process_time()
    for k in range(400):
        rig.skin(asked[k % len(asked)])
    used = time.process_time() - used
    rows = np.array([rig.inputs(each) for each in asked])[np.arange(50) % len(asked)]
    many, _ = _clock(lambda k: rig.own(rows), 10)
    return {
        "solve_ms": 1e3 * solver,
        "pose_ms": 1e3 * median,
        "pose_ms_least": 1e3 * least,
        "pose_cpu_ms": 1e3 * used / 400,
        "poses_per_s": 1 / median,
        "poses_per_s_batch": 50 / many,
    }


def baked(rig, head):
    """The `Keys` of a rig, as a bake chooses them, of the skin alone."""
    actor = actor_of(rig, head)
    poses = playing.played_poses(actor, np.random.default_rng(0))
    played = finish(playing.played_parts(actor, poses))
    lowest = {name: -1.0 if name in SIGNED else 0.0 for name in sliders(rig)}
    return finish(keys.chosen_keys(rig, poses, {"skin": played["skin"]}, lowest, head.eyes))


def sunk(model, head, poses, play) -> dict:
    """mm that the drawn lids are at most within an eyeball beyond rest, and in how many poses more than 0.1."""
    rows, _ = smoother(head.skin.faces, model.count, 2)
    rest = control(model, Pose())

    def depths(pose, asked):
        skin = rows @ play(pose, asked)
        out = []
        for lids in model.lids:
            away = np.linalg.norm(skin - lids.eye.centre, axis=1)
            depth = eyeball_radius(lids, skin, asked.gaze_of(lids.side)) - away
            out.append(np.where(away < lids.eye.radius + 3, depth, -1.0))
        return np.array(out)

    before = np.maximum(depths(Pose(), rest), 0)
    deepest = np.array([(depths(pose, control(model, pose)) - before).max() for pose in poses])
    return {"poses": len(poses), "max_mm": float(deepest.max()), "over": int((deepest > 0.1).sum())}


def main():
    """Measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--care", choices=tuple(sampling.COUNTS), default="normal")
    parser.add_argument("--unseen", type=int, default=12, help="poses of each kind that is drawn at random")
    parser.add_argument("--seed", type=int, default=2, help="which poses are drawn")
    options = parser.parse_args()
    head = load_head()
    model = build_model(head)
    names = model.muscle_names
    poses = sampling.drawn_poses(names, sampling.COUNTS[options.care], np.random.default_rng(0))
    begin, used = time.perf_counter(), time.process_time()
    samples = finish(sampling.sampled(model, poses))
    sampled, cpu = time.perf_counter() - begin, time.process_time() - used
    used = time.process_time()
    rig = finish(fit.fit_rig(model, samples, len(sampling.single_poses(names)), mirror.opposite_vertices(head)))
    fitted = time.process_time() - used
    size = len(storage.to_bytes(rig)) / 1e6
    print(f"{len(poses)} samples in {sampled:.0f} s ({cpu:.0f} s CPU), fitted in {fitted:.1f} s CPU, {size:.1f} MB")
    unseen = accuracy.unseen_poses(names, "all_jaw", 20, np.random.default_rng(99))
    quick = speed(rig, model, unseen)
    print("  ".join(f"{name} {value:.2f}" for name, value in quick.items()))
    used = time.process_time()
    shapes = baked(rig, head)
    counts = {"sliders": len(shapes.sliders), "driven": len(shapes.parts["skin"].driven)}
    print(f"shape keys chosen in {time.process_time() - used:.0f} s CPU: {counts}")
    found = finish(accuracy.measured(rig, model, count=options.unseen, seed=options.seed, keys=shapes))
    print(
        f"{'unseen poses':<14}{'poses':>6}{'rms':>8}{'median':>8}{'worst':>8}{'95 %':>8}{'max mm':>8}   and of shape keys"
    )
    for kind, row in found.items():
        numbers = ("rms_mm", "median_pose_rms_mm", "worst_pose_rms_mm", "p95_mm", "max_mm")
        both = [each[name] for each in (row, row["keys"]) for name in numbers]
        print(f"{kind:<14}{row['poses']:6d}" + "".join(f"{value:8.3f}" for value in both))
    looks = [(x, z, shut) for x in (-1, -0.5, 0, 0.5, 1) for z in (-1, 0, 1) for shut in (0, 0.5, 1)]
    places = {"arkit": [for_head(pose, names) for pose in arkit.poses().values()]}
    places["looks"] = [Pose(gaze_x=x, gaze_z=z, blink_l=shut, blink_r=shut) for x, z, shut in looks]
    eyeballs = {}
    for label, play in zip(("rig", "keys"), accuracy.plays_of(rig, shapes), strict=True):
        eyeballs[label] = {kind: sunk(model, head, each, play) for kind, each in places.items()}
    print(f"eyeballs: {eyeballs}")
    report = {"care": options.care, "samples": len(poses), "sampling_s": sampled, "sampling_cpu_s": cpu}
    report |= {"fit_cpu_s": fitted, "size_mb": size, "speed": quick, "keys": counts}
    print(json.dumps(report | {"unseen": found, "eyeballs": eyeballs}))


if __name__ == "__main__":
    main()
