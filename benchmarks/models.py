# SPDX-License-Identifier: GPL-3.0-or-later
"""Time of every model that can act on the reference head: to build it, for a pose from rest, and for a slider's pose.

    python benchmarks/models.py [--models waters headshop] [--poses smile joy]

A pose from rest is what a bake solves, with the numbers of its report. A slider's pose is what the face follows while a
slider is dragged: one that starts from another near by, without the numbers; for models that iterate, ten iterations of
it. Each is the best of several runs, in elapsed and in CPU seconds. Prints a table and, on the last line, the same as JSON.
"""

import argparse
import json
import time
from functools import partial

from headshop.sim.acting.expressions import expressions, for_head
from headshop.sim.acting.models import MODELS, model_named
from headshop.sim.acting.pose import control, pose_from
from headshop.sim.anatomy.storage import load_head

BAKE, LOOK = 200, 10  # iterations, as `headshop_addon.shape_keys` and `headshop_addon.live` ask for


def timed(runs: int, work, *given):
    """Best elapsed and CPU seconds of ``runs`` calls of ``work`` with what is given, and what the last returned."""
    elapsed, cpu = [], []
    for _ in range(runs):
        begin, busy = time.perf_counter(), time.process_time()
        result = work(*given)
        elapsed.append(time.perf_counter() - begin)
        cpu.append(time.process_time() - busy)
    return min(elapsed), min(cpu), result


def main():
    """Measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--models", nargs="+", choices=tuple(MODELS), default=list(MODELS))
    parser.add_argument("--poses", nargs="+", default=["smile", "joy"], help="names of expressions")
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    head, table, rows = load_head(), expressions(), []
    print(f"{len(head.skin.vertices)} skin vertices\n")
    columns = f"{'model':<10}{'pose':<12}{'build':>9}{'from rest':>11}{'CPU':>9}{'at rest':>9}{'slider':>11}{'CPU':>11}"
    print(columns + f"{'per second':>12}")
    for name in options.models:
        acting = model_named(name)
        built, _, model = timed(1, acting.build, head)
        for pose in options.poses:
            wanted = for_head(table[pose], model.muscle_names)
            near = pose_from({channel: 0.9 * value for channel, value in wanted.values().items()})
            asked, before = control(model, wanted), control(model, near)
            elapsed, cpu, solution = timed(options.runs, partial(acting.solve, max_iterations=BAKE), model, asked)
            state, _ = acting.look(model, before, acting.rest_state(model), BAKE)
            look, look_cpu, _ = timed(10 * options.runs, acting.look, model, asked, state, LOOK)
            row = {"model": name, "pose": pose, "build_s": built, "solve_s": elapsed, "solve_cpu_s": cpu}
            row |= {"converged": bool(solution.converged), "look_s": look, "look_cpu_s": look_cpu}
            rows.append(row)
            print(
                f"{name:<10}{pose:<12}{built:8.2f}s{elapsed:10.3f}s{cpu:8.3f}s{'yes' if solution.converged else 'no':>9}"
                f"{1e3 * look:9.2f}ms{1e3 * look_cpu:9.2f}ms{1 / look:12.0f}",
                flush=True,
            )
    print(json.dumps({"vertices": len(head.skin.vertices), "rows": rows}))


if __name__ == "__main__":
    main()
