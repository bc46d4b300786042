# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver frame by frame along a performance: time a frame, and how far the skin is from the converged pose.

    python benchmarks/frames.py [--fps 60] [--steps 7] [--tolerance 0.05] [--runs 3]

In 3.5 s the face smiles, laughs with the jaw falling open in 0.2 s, speaks (m a u i m), blinks twice, is angry and then
surprised. Every frame is also solved until it rests (each from the one before), contact included; the error is the root mean
square over all of the skin's vertices of what lies between. Times are of a frame as a whole (from control to skin), the
best of ``--runs``; whole solves of some of the same poses, from the scan and as a bake does them, are timed in the same
run. Prints a table and, on the last line, the same as JSON.
"""

import argparse
import json
import time

import numpy as np

from headshop.sim.acting.expressions import expressions
from headshop.sim.acting.performance import Performance
from headshop.sim.acting.pose import control
from headshop.sim.anatomy.storage import load_head
from headshop.sim.tissue.frames import STEPS, TOLERANCE, Frames
from headshop.sim.tissue.model import build_model
from headshop.sim.tissue.solver import solve

CLOSED = {"orbicularis_oris_upper": 0.35, "orbicularis_oris_lower": 0.35}
WIDE = {f"{name}_{side}": value for name, value in (("zygomaticus_major", 0.3), ("risorius", 0.5)) for side in "lr"}
BLINKS = ((0.0, 0.0), (0.5, 0.0), (0.6, 1.0), (0.65, 1.0), (0.8, 0.0), (1.9, 0.0), (2.0, 1.0), (2.05, 1.0), (2.2, 0.0))
EVERY = 10  # frames between those that are also solved from the scan


def performance(fps):
    """The `Performance`."""
    table = {name: pose.values() for name, pose in expressions().items()}

    def some(name, share=1.0, **more):
        return {channel: share * value for channel, value in table[name].items() if value} | more

    keys = (
        (0.0, {}),
        (0.4, some("smile")),
        (0.7, some("smile")),
        (0.9, some("smile", jaw_open=0.5)),
        (1.1, some("smile", 0.5, jaw_open=0.15)),
        (1.25, CLOSED),
        (1.4, {"jaw_open": 0.45}),
        (1.55, some("pucker", 0.7, jaw_open=0.15)),
        (1.7, WIDE | {"jaw_open": 0.12}),
        (1.85, CLOSED),
        (2.0, {}),
        (2.5, some("anger")),
        (2.8, some("anger")),
        (3.1, some("surprise", gaze_x=0.5)),
        (3.5, {}),
    )
    names = sorted({name for _, pose in keys for name in pose})
    channels = {name: tuple((t, pose.get(name, 0.0)) for t, pose in keys) for name in names}
    return Performance(channels | {"blink_l": BLINKS, "blink_r": BLINKS}, fps)


def followed(model, controls, options):
    """Skins (f, n, 3), seconds elapsed and of CPU a frame (f,), and the mean of steps."""
    frames = Frames(model)
    skins, elapsed, used, steps = [], [], [], 0
    for asked in controls:
        begin, spent = time.perf_counter(), time.process_time()
        skins.append(frames.follow(asked, options.steps, options.tolerance).skin)
        elapsed.append(time.perf_counter() - begin)
        used.append(time.process_time() - spent)
        steps += frames.iterations
    return np.array(skins), np.array(elapsed), np.array(used), steps / len(controls)


def main():
    """Measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--fps", type=float, default=60.0, help="frames a second of the performance")
    parser.add_argument("--steps", type=int, default=STEPS, help="steps of the solver a frame, at most")
    parser.add_argument("--tolerance", type=float, default=TOLERANCE, help="mm of a step at which fewer do")
    parser.add_argument("--runs", type=int, default=3, help="the shortest time of so many runs counts")
    options = parser.parse_args()
    model = build_model(load_head())
    acted = performance(options.fps)
    controls = [control(model, pose) for pose in acted.frames()]
    runs = [followed(model, controls, options) for _ in range(options.runs)]
    skins, steps = runs[0][0], runs[0][3]
    elapsed, used = (1e3 * np.min([run[k] for run in runs], axis=0) for k in (1, 2))
    state, errors, whole, warm = None, [], [], []
    for number, (asked, skin) in enumerate(zip(controls, skins, strict=True)):
        if number % EVERY == 0:
            begin = time.perf_counter()
            solve(model, asked)
            whole.append(time.perf_counter() - begin)
            begin = time.perf_counter()
            solve(model, asked, state)
            warm.append(time.perf_counter() - begin)
        state = solve(model, asked, state, max_iterations=400, tolerance=2e-3).state
        errors.append(np.sqrt(((skin - state.skin) ** 2).sum(axis=1).mean()))
    errors = np.array(errors)
    row = {
        "fps": options.fps,
        "frames": len(controls),
        "steps": steps,
        "ms_median": float(np.median(elapsed)),
        "ms_mean": float(elapsed.mean()),
        "ms_p95": float(np.percentile(elapsed, 95)),
        "cpu_ms_mean": float(used.mean()),
        "frames_per_second": float(1e3 / elapsed.mean()),
        "rms_median_mm": float(np.median(errors)),
        "rms_mean_mm": float(errors.mean()),
        "rms_p95_mm": float(np.percentile(errors, 95)),
        "rms_max_mm": float(errors.max()),
        "share_within_0.05_mm": float((errors <= 0.05).mean()),
        "solve_ms": float(1e3 * np.median(whole)),
        "solve_from_last_ms": float(1e3 * np.median(warm)),
    }
    print(f"{len(controls)} frames at {options.fps:g} a second, {steps:.1f} steps each")
    print(
        "frame      median {ms_median:.1f} ms, mean {ms_mean:.1f}, 95 % {ms_p95:.1f}; CPU {cpu_ms_mean:.1f}".format(
            **row
        )
    )
    print("           {frames_per_second:.0f} frames a second on average".format(**row))
    print("off rest   median {rms_median_mm:.3f} mm rms, mean {rms_mean_mm:.3f}".format(**row), end="")
    print(", 95 % {rms_p95_mm:.3f}, worst {rms_max_mm:.3f}".format(**row))
    print("           {:.0%} of the frames within 0.05 mm".format(row["share_within_0.05_mm"]))
    print("solve      {solve_ms:.0f} ms from the scan, {solve_from_last_ms:.0f} ms from the frame before".format(**row))
    print(json.dumps(row))


if __name__ == "__main__":
    main()
