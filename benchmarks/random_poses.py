# SPDX-License-Identifier: GPL-3.0-or-later
"""How much the tissue bears: poses that nobody asks for, muscles at random and the jaw anywhere, each solved from the scan.

    python benchmarks/random_poses.py [--poses 1000] [--iterations 150] [--seed 1]

Prints what did not come to rest within the iterations, the worst step left, inverted prisms, volume drift, penetration and
the farthest that a vertex of the skin lies from where the jaw alone would carry it; and, on the last line, the same as
JSON. Exit status 1 if anything is not a number.
"""

import argparse
import json
import time

import numpy as np

from headshop.sim.acting.pose import control
from headshop.sim.acting.random_poses import random_pose
from headshop.sim.anatomy.storage import load_head
from headshop.sim.tissue.energy import pose_of
from headshop.sim.tissue.model import build_model
from headshop.sim.tissue.solver import solve

REPORTED = ("inverted_prisms", "volume_drift", "penetration_mm", "bone_penetration_mm", "peak_mm")


def main():
    """Measure, print; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--poses", type=int, default=1000)
    parser.add_argument("--iterations", type=int, default=150)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    model = build_model(load_head())
    rows, finite = [], True
    begin = time.process_time()
    for number in range(options.poses):
        pose = random_pose(model.muscle_names, np.random.default_rng([options.seed, number]))
        asked = control(model, pose)
        solution = solve(model, asked, max_iterations=options.iterations)
        off = (solution.state.positions - pose_of(model, asked).reference)[: model.count]
        finite = finite and bool(np.isfinite(off).all())
        row = {name: abs(float(solution.diagnostics[name])) for name in REPORTED}
        row |= {"residual": solution.residual, "iterations": solution.iterations, "converged": solution.converged}
        rows.append(row | {"off_mm": float(np.linalg.norm(off, axis=1).max())})
        if not solution.converged:
            print(f"pose {number}: a step of {solution.residual:.3f} mm left after {solution.iterations}", flush=True)
    seconds = time.process_time() - begin
    columns = {name: np.array([row[name] for row in rows], float) for name in rows[0]}
    left = len(rows) - int(columns.pop("converged").sum())
    print(f"{len(rows)} poses, {len(model.prisms)} prisms, {seconds / len(rows):.2f} s of CPU each")
    print(f"not at rest after {options.iterations} iterations: {left}; all finite: {finite}\n")
    print(f"{'':<22}{'median':>9}{'95 %':>9}{'worst':>9}")
    result = {"poses": len(rows), "not_converged": left, "finite": finite, "cpu_s_each": seconds / len(rows)}
    for name, values in columns.items():
        found = [float(np.percentile(values, share)) for share in (50, 95, 100)]
        result[name] = found
        print(f"{name:<22}" + "".join(f"{value:9.3f}" for value in found))
    print(json.dumps(result))
    return 0 if finite else 1


if __name__ == "__main__":
    raise SystemExit(main())
