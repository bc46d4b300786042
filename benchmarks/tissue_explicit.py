# SPDX-License-Identifier: GPL-3.0-or-later
"""The face of Lee, Terzopoulos and Waters 1995 in motion: what its explicit steps cost as the tissue gets stiffer, beside
the implicit steps of our own solver in the same run; and how far behind its muscles it is.

    python benchmarks/tissue_explicit.py [--stiffness 1 100 1000] [--frames 3]

A smile is switched on at rest and followed for some frames of 1/24 s. All of the stiffness (springs, volume, shape,
restoration) and the muscles' strength are multiplied. Seconds are of the processor. The lag is the peak of the skin's
motion over two periods of a smile that comes and goes, in shares of the smile held still. Prints tables and, on the last
line, the same as JSON.
"""

import argparse
import json
import time
from dataclasses import replace

import numpy as np

from headshop.sim.acting.expressions import expressions
from headshop.sim.acting.pose import control
from headshop.sim.anatomy.storage import load_head
from headshop.sim.tissue import model as ours
from headshop.sim.tissue.dynamics import step as implicit_step
from headshop.sim.tissue.lee1995 import model as lee
from headshop.sim.tissue.lee1995 import solver as lee_solver
from headshop.sim.tissue.lee1995.constants import DEFAULT
from headshop.sim.tissue.solver import rest_state

FRAME = 1 / 24
SCALED = (
    *("epidermis", "dermal_fatty", "dermal_fatty_stiff", "fascia", "muscle_layer"),
    *("volume", "shape", "restoration"),
)


def per_frame(step, rest, model, wanted, frames):
    """Processor seconds per frame after the first, and how far the skin's peak has come by the last, mm."""
    state = step(model, rest, wanted, FRAME)
    begin = time.process_time()
    for _ in range(frames):
        state = step(model, state, wanted, FRAME)
    seconds = (time.process_time() - begin) / frames
    return seconds, float(np.linalg.norm(state.skin - rest.skin, axis=1).max())


def lag(model, wanted, hertz):
    """The skin's peak, mm, while activations go as a raised cosine for two periods."""
    state, peak = lee_solver.rest_state(model), 0.0
    rest = state.skin
    for k in range(int(round(2 / hertz / FRAME))):
        share = 0.5 - 0.5 * np.cos(2 * np.pi * hertz * (k + 1) * FRAME)
        state = lee_solver.step(model, state, replace(wanted, activations=share * wanted.activations), FRAME)
        peak = max(peak, float(np.linalg.norm(state.skin - rest, axis=1).max()))
    return peak


def main():
    """Measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--stiffness", nargs="+", type=float, default=[1, 100, 1000])
    parser.add_argument("--frames", type=int, default=3)
    options = parser.parse_args()
    head = load_head()
    own = ours.build_model(head)
    smile = expressions()["smile"]
    rows, face = [], None
    print(f"{'stiffness':>9}{'step':>10}{'steps/s':>9}{'explicit':>12}{'implicit':>12}{'ratio':>8}")
    for factor in options.stiffness:
        constants = replace(DEFAULT, **{k: factor * getattr(DEFAULT, k) for k in SCALED})
        model = lee.build_model(head, constants)
        face = model if factor == 1 else face
        explicit, reached = per_frame(
            lee_solver.step, lee_solver.rest_state(model), model, control(model, smile), options.frames
        )
        parameters = replace(own.parameters, dynamic_scale=factor * own.parameters.dynamic_scale)
        stiff = replace(own, parameters=parameters, cache={"matrix": own.cache["matrix"]})
        implicit, _ = per_frame(implicit_step, rest_state(own), stiff, control(own, smile), options.frames)
        steps = int(np.ceil(FRAME / model.time_step)) / FRAME
        rows.append(
            {
                "stiffness": factor,
                "time_step_s": model.time_step,
                "explicit_s_per_frame": explicit,
                "implicit_s_per_frame": implicit,
                "reached_mm": reached,
            }
        )
        print(
            f"{factor:9g}{model.time_step * 1e3:7.3f} ms{steps:9.0f}{explicit * 1e3:9.0f} ms{implicit * 1e3:9.0f} ms"
            f"{explicit / implicit:7.1f}x"
        )
    lags = {}
    if face is not None:
        wanted = control(face, smile)
        still = lee_solver.solve(face, wanted).diagnostics["peak_mm"]
        for hertz in (0.25, 1.0, 2.5):
            lags[hertz] = lag(face, wanted, hertz) / still
            print(f"smile at {hertz:4.2f} Hz: {100 * lags[hertz]:3.0f} % of its motion when held")
    print(json.dumps({"rows": rows, "lag": lags}))


if __name__ == "__main__":
    main()
