# SPDX-License-Identifier: GPL-3.0-or-later
"""The response rig of the shipped head: how long it takes to learn, poses a second beside a solve in the same run, errors.

    python benchmarks/response.py [--care normal] [--unseen 12]

Errors are against the converged simulation (contacts and all) on poses that were no samples: one, three or all muscles
at random, the same with the jaw anywhere in its range, all expressions and all ARKit shapes.
Prints a table and, on the last line, the same as JSON.
"""

import argparse
import json
import time

import numpy as np

from headshop.sim.acting.pose import control
from headshop.sim.anatomy.storage import load_head
from headshop.sim.progress import finish
from headshop.sim.response import accuracy, fit, mirror, sampling, storage
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
    rows = np.array([rig.inputs(each) for each in asked])[np.arange(50) % len(asked)]
    many, _ = _clock(lambda k: rig.own(rows), 10)
    return {
        "solve_ms": 1e3 * solver,
        "pose_ms": 1e3 * median,
        "pose_ms_least": 1e3 * least,
        "poses_per_s": 1 / median,
        "poses_per_s_batch": 50 / many,
    }


def main():
    """Measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--care", choices=tuple(sampling.COUNTS), default="normal")
    parser.add_argument("--unseen", type=int, default=12, help="poses of each kind that is drawn at random")
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
    found = finish(accuracy.measured(rig, model, count=options.unseen))
    print(f"{'unseen poses':<14}{'poses':>6}{'rms':>8}{'median':>8}{'worst':>8}{'95 %':>8}{'max mm':>8}")
    for kind, row in found.items():
        numbers = ("rms_mm", "median_pose_rms_mm", "worst_pose_rms_mm", "p95_mm", "max_mm")
        print(f"{kind:<14}{row['poses']:6d}" + "".join(f"{row[name]:8.3f}" for name in numbers))
    report = {"care": options.care, "samples": len(poses), "sampling_s": sampled, "sampling_cpu_s": cpu}
    print(json.dumps(report | {"fit_cpu_s": fitted, "size_mb": size, "speed": quick, "unseen": found}))


if __name__ == "__main__":
    main()
