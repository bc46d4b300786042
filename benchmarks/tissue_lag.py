# SPDX-License-Identifier: GPL-3.0-or-later
"""How far behind its muscles the face of Lee, Terzopoulos and Waters 1995 is: the peak of the skin's motion over two
periods of a smile that comes and goes, in shares of the smile held still."""

from dataclasses import replace

import numpy as np
from tissue_clip import FRAME

from headshop.sim.acting.expressions import expressions
from headshop.sim.acting.pose import control
from headshop.sim.tissue.lee1995.model import build_model
from headshop.sim.tissue.lee1995.solver import rest_state, solve, step


def rows(head, rates=(0.25, 1.0, 2.5)):
    """Yields a row for each rate, in Hz."""
    face = build_model(head)
    wanted = control(face, expressions()["smile"])
    still = solve(face, wanted).diagnostics["peak_mm"]
    for hertz in rates:
        yield {"hertz": hertz, "share": peak(face, wanted, hertz) / still}


def peak(model, wanted, hertz) -> float:
    """The skin's peak, mm, while activations go as a raised cosine for two periods."""
    state, farthest = rest_state(model), 0.0
    rest = state.skin
    for k in range(int(round(2 / hertz / FRAME))):
        share = 0.5 - 0.5 * np.cos(2 * np.pi * hertz * (k + 1) * FRAME)
        state = step(model, state, replace(wanted, activations=share * wanted.activations), FRAME)
        farthest = max(farthest, float(np.linalg.norm(state.skin - rest, axis=1).max()))
    return farthest
