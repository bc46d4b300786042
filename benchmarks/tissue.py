# SPDX-License-Identifier: GPL-3.0-or-later
"""Time to bring a pose to rest: the solver, beside explicit Euler on the very same springs in the same run.

    python benchmarks/tissue.py [--poses smile jaw_open] [--limit 90]

Explicit Euler is what Lee, Terzopoulos and Waters 1995 used (3.8), in its more stable symplectic form, with the largest
time step that stays stable (found by halving), the model's masses and damping, and the forces of the same energy. It
counts as at rest when the skin lies within ``--near`` mm (root mean square) of the solver's converged pose, or is given
up after ``--limit`` seconds; then its ratio is a lower bound. Prints a table and, on the last line, the same as JSON.
"""

import argparse
import json
import time

import numpy as np

from headshop.sim.acting.expressions import expressions
from headshop.sim.acting.pose import control
from headshop.sim.anatomy.storage import load_head
from headshop.sim.tissue.energy import energy_gradient, find_contacts, pose_of
from headshop.sim.tissue.model import build_model
from headshop.sim.tissue.solver import rest_state, solve

CONTACTS_EVERY = 20  # steps of the explicit method: the solver looks for them every 6 of its much longer ones


def explicit(model, wanted, dt, steps, target=None, near=0.0, limit=np.inf):
    """Positions after at most ``steps``, the steps made, the seconds they took and the error left on the skin, mm."""
    pose = pose_of(model, wanted)
    free = model.cache["matrix"]["free"]
    mass = model.mass[free][:, None]
    scale, damping = model.parameters.dynamic_scale, model.parameters.damping_rate
    x = rest_state(model).positions
    x[2 * model.count :] = pose.reference[2 * model.count :]
    held = np.setdiff1d(np.arange(2 * model.count), free)
    x[held] = pose.reference[held]
    v = np.zeros((len(free), 3))
    begin, error = time.perf_counter(), np.inf
    for k in range(steps):
        if k % CONTACTS_EVERY == 0:
            planes = find_contacts(model, pose, x)
            if target is not None:
                error = np.sqrt(((x[: model.count] - target) ** 2).sum(axis=1).mean())
                if error < near or time.perf_counter() - begin > limit:
                    break
        _, gradient = energy_gradient(model, pose, planes, x)
        v += dt * (-scale * gradient / mass - damping * v)
        x[free] += dt * v
        if k % 10 == 0 and not (np.abs(v).max() < 1e6):
            return x, k, time.perf_counter() - begin, np.inf
    return x, k, time.perf_counter() - begin, error


def largest_step(model, wanted, trial=120):
    """The largest time step of 2^-k seconds at which ``trial`` explicit steps stay bounded."""
    for k in range(5, 24):
        with np.errstate(all="ignore"):  # most steps tried blow up
            x, *_ = explicit(model, wanted, 2.0**-k, trial)
        farthest = np.abs(x - rest_state(model).positions).max()
        if np.isfinite(farthest) and farthest < 60:
            return 2.0**-k
    raise RuntimeError("no stable step found")


def main():
    """Measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--poses", nargs="+", default=["smile", "jaw_open"], help="names of expressions")
    parser.add_argument("--near", type=float, default=0.1, help="mm from the converged pose that count as at rest")
    parser.add_argument("--limit", type=float, default=90.0, help="seconds given to explicit Euler per pose")
    options = parser.parse_args()
    begin = time.perf_counter()
    model = build_model(load_head())
    built = time.perf_counter() - begin
    table = expressions()
    print(f"{model.count} columns, {len(model.springs.rest)} springs, {len(model.prisms)} prisms")
    print(f"model built in {built:.2f} s\n")
    heads = f"{'pose':<14}{'solve':>9}{'steps':>7}{'converged':>11}{'explicit Euler':>18}{'steps of':>10}{'left mm':>9}"
    print(heads + f"{'ratio':>9}")
    rows = []
    for name in options.poses:
        wanted = control(model, table[name])
        runs = []
        for _ in range(3):
            begin = time.perf_counter()
            solution = solve(model, wanted)
            runs.append(time.perf_counter() - begin)
        target = solve(model, wanted, solution.state, max_iterations=300, tolerance=1e-4).state.positions[: model.count]
        dt = largest_step(model, wanted)
        _, steps, seconds, left = explicit(model, wanted, dt, 10**7, target, options.near, options.limit)
        reached = left < options.near
        ratio = seconds / min(runs)
        rows.append(
            {
                "pose": name,
                "solve_s": min(runs),
                "iterations": solution.iterations,
                "converged": bool(solution.converged),
                "explicit_s": seconds,
                "explicit_steps": steps,
                "explicit_dt_s": dt,
                "explicit_left_mm": float(left),
                "explicit_reached": bool(reached),
                "ratio": ratio,
            }
        )
        print(
            f"{name:<14}{min(runs):8.2f}s{solution.iterations:7d}{str(bool(solution.converged)):>11}{seconds:17.1f}s"
            f"{dt * 1e6:7.0f} us{left:9.2f}{'' if reached else '>':>3}{ratio:5.0f}x"
        )
    print(json.dumps({"columns": model.count, "build_s": built, "rows": rows}))


if __name__ == "__main__":
    main()
