# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames a second of the tissue: every model at rest and in motion by stiffness, explicit integration of the same springs
and Blender's own bodies in the same run, and how time grows with the mesh and the springs.

    python benchmarks/tissue.py [--parts models explicit blender meshes springs lag] [--frames 12] [--quick]

All act a clip of the sample's smile at 24 frames a second; in motion, the head of our own model is shaken besides. Columns
are processor milliseconds a frame (of all threads; elapsed ones are in the JSON) and errors in mm, root mean square over
skin and frames: at rest, against the same model solved to 0.001 mm; in motion, against the same steps solved to 0.0001 mm;
in the part ``explicit``, against explicit integration with all its small steps, which is the truth in time. Stiffness
multiplies all forces against the masses. Times compare within a run only. Prints tables and, on the last line, the same as
JSON. All takes five to ten minutes of a processor, ``--quick`` two.
"""

import argparse
import json

import tissue_blender
import tissue_explicit
import tissue_lag
import tissue_models
import tissue_scaling
from tissue_clip import FRAME, clip, root_mean_square, stiffer

from headshop.sim.anatomy.storage import load_head
from headshop.sim.tissue.model import build_model
from headshop.sim.tissue.solver import solve

PARTS = ("models", "explicit", "blender", "meshes", "springs", "lag")
STIFFNESS, SIZES, SHARES = (1, 100, 1000), (0.5, 1, 2, 4, 8), (1, 2, 4, 8)


def table(title: str, columns, rows):
    """Print rows as they come; columns are (key, heading, width, format or function of the row). Returns the rows."""
    print(f"\n{title}\n" + "".join(f"{heading:>{width}}" for _, heading, width, _ in columns), flush=True)
    done = []
    for row in rows:
        cells = [
            f"{row[key] * scale:{form}}" if row.get(key) is not None else "-" for key, scale, form in _cells(columns)
        ]
        print("".join(f"{cell:>{column[2]}}" for cell, column in zip(cells, columns, strict=True)), flush=True)
        done.append(row)
    return done


def _cells(columns):
    for key, _, _, form in columns:
        yield (key, 1e3, form[3:]) if form.startswith("ms ") else (key, 1, form)


def models(head, own, options):
    """Every model by stiffness."""
    columns = [("model", "model", 10, "s"), ("kind", "", 12, "s"), ("stiffness", "stiffness", 11, "g")]
    columns += [("cpu_s", "ms a frame", 12, "ms .1f"), ("error_mm", "error", 9, ".4f"), ("worst_mm", "worst", 9, ".4f")]
    return table("Models", columns, tissue_models.rows(head, own, options.stiffness, options.frames))


def explicit(_head, own, options):
    """Ours in motion beside explicit integration of the same springs, and both against the truth in time."""

    def rows():
        for factor in options.stiffness:
            model = stiffer(own, factor)
            controls = clip(model, options.frames + 1, shaken=True)
            state = solve(model, controls[0]).state
            theirs = tissue_explicit.measured(model, state, controls)
            ours = tissue_models.in_motion("headshop", model, options.frames)
            ratio = theirs["cpu_s"] / ours["cpu_s"]
            real = FRAME / ours["cpu_s"]
            yield {"stiffness": factor, **theirs, "ours_cpu_s": ours["cpu_s"], "ratio": ratio, "real_time": real}

    columns = [("stiffness", "stiffness", 11, "g"), ("steps", "steps a frame", 15, "d"), ("made", "made", 7, "d")]
    columns += [
        ("cpu_s", "ms a frame", 12, "ms .0f"),
        ("ours_cpu_s", "ours", 9, "ms .1f"),
        ("ratio", "times", 9, ".1f"),
    ]
    columns += [("real_time", "ours by real time", 19, ".2f")]
    out = table("Explicit integration of the same springs", columns, rows())
    few = 3 if options.quick else 6
    controls = clip(own, few + 1, shaken=True)
    state = solve(own, controls[0], max_iterations=300, tolerance=1e-3).state
    truth = tissue_explicit.path(own, state, controls)

    def errors():
        for parts in (1, 2, 4):
            path = tissue_models.tight(own, controls, state, parts)
            yield {"parts": parts, "error_mm": root_mean_square(path, truth)}
        yield {"parts": 0, "error_mm": root_mean_square([state.skin] * few, truth)}

    columns = [("parts", "steps a frame", 15, "d"), ("error_mm", "error", 9, ".4f")]
    return {
        "cost": out,
        "truth": table("Our steps against the truth in time (0: the face does not move)", columns, errors()),
    }


def blender(_head, own, options):
    """Blender's own bodies."""
    if not tissue_blender.available():
        print("\nBlender's soft body and cloth: skipped, Blender's module (bpy) is not installed")
        return []
    columns = [("body", "", 32, "s"), ("stiffness", "stiffness", 11, "g"), ("cpu_s", "ms a frame", 12, "ms .1f")]
    columns += [("elapsed_s", "elapsed", 9, "ms .1f"), ("peak_mm", "moves mm", 10, ".1f")]
    rows = tissue_blender.rows(own, options.stiffness, options.frames)
    return table(
        "A shaken head whose face is at rest, by Blender's own bodies (a dash: they left the finite numbers)",
        columns,
        rows,
    )


_GROWTH = [("times", "times", 8, "g"), ("vertices", "vertices", 10, "d"), ("springs", "springs", 10, "d")]
_GROWTH += [("rest_cpu_s", "at rest ms", 12, "ms .1f"), ("rest_error_mm", "error", 9, ".4f")]
_GROWTH += [("motion_cpu_s", "in motion ms", 14, "ms .1f"), ("motion_error_mm", "error", 9, ".4f")]
_GROWTH += [("explicit_cpu_s", "explicit ms", 13, "ms .0f")]


def meshes(head, _own, options):
    """Growth with the mesh."""
    return table("Size of the mesh", _GROWTH, tissue_scaling.meshes(head, options.sizes, options.few))


def springs(_head, own, options):
    """Growth with the springs."""
    return table(
        "Number of springs on the same mesh", _GROWTH, tissue_scaling.springs(own, options.shares, options.few)
    )


def lag(head, _own, _options):
    """How far behind its muscles the face of 1995 is."""
    columns = [("hertz", "smile at Hz", 13, ".2f"), ("share", "reaches", 9, ".0%")]
    return table("Lee, Terzopoulos and Waters 1995, of its motion when held", columns, tissue_lag.rows(head))


def main():
    """Measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--frames", type=int, default=24)
    parser.add_argument("--stiffness", nargs="+", type=float, default=STIFFNESS)
    parser.add_argument(
        "--sizes", nargs="+", type=float, default=SIZES, help="of the skin, beside the reference head's"
    )
    parser.add_argument("--shares", nargs="+", type=int, default=SHARES, help="springs for each of the model's")
    parser.add_argument("--quick", action="store_true", help="fewer frames, sizes and parts")
    options = parser.parse_args()
    options.few = 4
    if options.quick:
        options.frames, options.few, options.sizes, options.shares = 6, 2, (0.5, 1, 2), (1, 2)
        options.stiffness = [k for k in options.stiffness if k != 100]
        options.parts = [part for part in options.parts if part != "lag"]
    head = load_head()
    own = build_model(head)
    print(f"{own.count} skin vertices, {len(own.springs.rest)} springs, {len(own.prisms)} prisms")
    print(json.dumps({part: globals()[part](head, own, options) for part in PARTS if part in options.parts}))


if __name__ == "__main__":
    main()
