# SPDX-License-Identifier: GPL-3.0-or-later
"""How deep surfaces reach into each other in the ARKit shapes and in random pairs of them, and what volume does.

    python benchmarks/penetration.py [--pairs 300] [--seed 0] [--levels 2]

Each pose is solved from rest on the reference head, as a bake does it; a pair is both poses' channels at once. Then all of the
skin as it is drawn is measured against the meshes themselves, not where and how the solver looks
(`sim/health/penetration.py`); gums are left to `report.json`. Closed lids: the largest gap between the lids' drawn edges at a
blink. Lips: the least gap between them on /p b m/.
Prints a table and, on the last line, the same as JSON.
"""

import argparse
import json
import time

import numpy as np

from headshop.sim.acting.arkit import over, poses
from headshop.sim.acting.pose import Pose, combined, control
from headshop.sim.anatomy.storage import load_head
from headshop.sim.health.penetration import NAMES, Ruler
from headshop.sim.tissue.energy import pose_of
from headshop.sim.tissue.model import build_model
from headshop.sim.tissue.solver import solve

LIMIT = 0.1
#: Lips pressed together as for /p b m/, with the jaw as it then is.
CLOSED = Pose({"orbicularis_oris_upper": 0.35, "orbicularis_oris_lower": 0.35}, jaw_open=0.03)


def lid_gap(model) -> float:
    """mm: the largest gap that a blink leaves between the drawn edges of the lids; 0 where they overlap all along."""
    skin = solve(model, control(model, Pose(blink_l=1.0, blink_r=1.0)), max_iterations=200).state.skin
    between = [
        lids.eye.radius * lids.edge.gap(skin, lids.upper, lids.within)[lids.opening > 0.02].max() for lids in model.lids
    ]
    return max(0.0, *map(float, between))


def main():
    """Measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--pairs", type=int, default=300, help="random pairs of shapes")
    parser.add_argument("--seed", type=int, default=0, help="which pairs")
    parser.add_argument("--levels", type=int, default=2, help="subdivisions of the skin that is measured")
    options = parser.parse_args()
    head = load_head()
    model = build_model(head)
    ruler = Ruler(head, model, pose_of(model, control(model, Pose())), options.levels)
    shapes = poses()
    for name, base in over().items():
        shapes[name] = combined(shapes[name], shapes[base])
    names = list(shapes)
    every = [(a, b) for k, a in enumerate(names) for b in names[k + 1 :]]
    chosen = np.random.default_rng(options.seed).permutation(len(every))[: options.pairs]
    runs = [(name, shapes[name]) for name in names]
    runs += [("+".join(every[k]), combined(*(shapes[name] for name in every[k]))) for k in sorted(chosen)]
    rows, begin = [], time.perf_counter()
    for name, pose in runs:
        asked = control(model, pose)
        solution = solve(model, asked, max_iterations=200)
        depth = ruler(solution.state.positions, pose_of(model, asked))
        found = solution.diagnostics
        rows.append(
            (name, depth, found["penetration_of"], found["volume_drift"], found["inverted_prisms"], solution.converged)
        )
    print(f"{len(rows)} poses, {len(names)} shapes and {len(chosen)} pairs, {time.perf_counter() - begin:.0f} s")
    out = {"poses": len(rows), "at_rest": sum(row[5] for row in rows)}
    for pair in NAMES:
        depth = np.array([row[1][pair] for row in rows])
        worst = int(depth.argmax())
        out[pair] = {
            "max_mm": round(float(depth.max()), 3),
            "p95_mm": round(float(np.percentile(depth, 95)), 3),
            "over": int((depth > LIMIT).sum()),
            "worst": rows[worst][0],
            "own_max_mm": round(max(row[2][pair] for row in rows), 3),
        }
        print(
            f"{pair:13} deepest {depth.max():.3f} mm ({rows[worst][0]}), 95 % {np.percentile(depth, 95):.3f},", end=" "
        )
        print(f"over {LIMIT} mm: {out[pair]['over']}; as the solver tells it {out[pair]['own_max_mm']:.3f}")
    out["cheek_gum_own_max_mm"] = round(max(row[2]["cheek_gum"] for row in rows), 3)
    drift = np.array([abs(row[3]) for row in rows])
    out["volume_drift_max"] = round(float(drift.max()), 4)
    out["inverted_prisms_max"] = max(row[4] for row in rows)
    pressed = solve(model, control(model, CLOSED), max_iterations=200).state.positions
    out["lip_gap_pbm_mm"] = round(ruler.lip_gap(pressed), 3)
    out["lid_gap_mm"] = round(lid_gap(model), 3)
    print(f"volume drift at most {drift.max():.2%}; inverted prisms at most {out['inverted_prisms_max']}", end="; ")
    print(f"at rest {out['at_rest']} of {len(rows)}; lips apart on /p b m/ {out['lip_gap_pbm_mm']} mm", end="; ")
    print(f"drawn edges of shut lids apart by at most {out['lid_gap_mm']} mm")
    print(json.dumps(out))


if __name__ == "__main__":
    main()
