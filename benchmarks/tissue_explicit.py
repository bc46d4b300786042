# SPDX-License-Identifier: GPL-3.0-or-later
"""Explicit integration of the very same springs, masses and forces as our own model's: symplectic Euler (Lee, Terzopoulos
and Waters 1995, 3.9 is explicit Euler, which is less stable) at the largest step that stays stable.

Steps that many frames would need are not all made: some are, and the frame's time is theirs times the steps it takes.
"""

from itertools import pairwise

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh
from tissue_clip import FRAME, Clock

from headshop.sim.tissue.dynamics import control_between
from headshop.sim.tissue.energy import find_contacts, pose_of
from headshop.sim.tissue.forces import Landscape

CONTACTS = 24  # times a frame that contacts are looked for (the implicit steps do so twice)
TRIAL = 150  # steps that a time step must survive


class Explicit:
    """Nodes of ``model`` on their way from ``state``; `frame` takes them through a frame."""

    def __init__(self, model, state):
        self.model = model
        self.free = model.cache["matrix"]["free"]
        self.mass = model.mass[self.free][:, None] / model.parameters.dynamic_scale
        self.x, self.v = state.positions.copy(), state.velocities[self.free].copy()

    def frame(self, before, after, dt: float, most: int | None = None) -> int:
        """The steps made towards the control ``after`` a frame later: all, or ``most`` of them."""
        count = int(np.ceil(FRAME / dt))
        every = max(1, count // CONTACTS)
        done = count if most is None else min(most, count)
        for k in range(done):
            if k % every == 0:
                pose = pose_of(self.model, control_between(before, after, (k + every) / count))
                held = np.setdiff1d(np.arange(len(self.x)), self.free)
                self.x[held] = pose.reference[held]
                at = Landscape(self.model, pose, find_contacts(self.model, pose, self.x))
            _, gradient = at(at.free(self.x))
            self.v -= FRAME / count * (gradient.T / self.mass + self.model.parameters.damping_rate * self.v)
            self.x[self.free] += FRAME / count * self.v
            if k % 10 == 0 and not np.abs(self.v).max() < 1e6:
                return 0
        return done if np.isfinite(self.x).all() else 0


def largest_step(model, state, controls) -> float:
    """s: from what the largest rate of the springs at rest allows, by factors of 1.3 to what survives `TRIAL` steps."""
    free = model.cache["matrix"]["free"]
    root = sparse.diags(np.sqrt(model.parameters.dynamic_scale / model.mass[free]))
    rate = eigsh(root @ model.cache["matrix"]["system"] @ root, k=1, tol=1e-2, return_eigenvectors=False)[0]
    dt = 4 / np.sqrt(rate)
    with np.errstate(all="ignore"):  # most steps tried blow up
        while not Explicit(model, state).frame(*controls[:2], dt, TRIAL):
            dt /= 1.3
    return float(dt)


def measured(model, state, controls, most: int = 200) -> dict:
    """What a frame costs, by ``most`` steps of it."""
    dt = largest_step(model, state, controls)
    with Clock() as clock:
        done = Explicit(model, state).frame(controls[0], controls[1], dt, most)
    count = int(np.ceil(FRAME / dt))
    share = count / max(done, 1)
    return {"cpu_s": clock.cpu * share, "elapsed_s": clock.elapsed * share, "steps": count, "made": done, "dt_s": dt}


def path(model, state, controls) -> list:
    """The skin at the end of every frame after the first, all steps made: the truth in time."""
    nodes, out = Explicit(model, state), []
    dt = largest_step(model, state, controls) / 1.3
    for before, after in pairwise(controls):
        nodes.frame(before, after, dt)
        out.append(nodes.x[: model.count].copy())
    return out
