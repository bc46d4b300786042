# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of the tissue in time.

`step` is one implicit Euler step of the equations of motion of Lee, Terzopoulos and Waters 1995, 3.8, as the minimum of
the energy plus inertia: stable at any dt.
"""

import numpy as np

from .energy import energy_gradient, find_contacts, pose_of
from .solver import factorised, minimise
from .structures import Control, Model, State


def step(model: Model, state: State, control: Control, dt: float, *, max_iterations: int = 12) -> State:
    """The state ``dt`` seconds later: m a + gamma v + forces = muscles (3.8), implicit Euler."""
    pose = pose_of(model, control)
    free = model.cache["matrix"]["free"]
    p = model.parameters
    mass = model.mass[free][:, None]
    scale = p.dynamic_scale
    ahead = state.positions[free] + dt * state.velocities[free]
    here = state.positions[free]
    start = pose.reference.copy()
    start[free] = here

    def value(x, planes):
        energy, gradient = energy_gradient(model, pose, planes, x)
        flight, drag = x[free] - ahead, x[free] - here
        inertia = mass * flight / dt**2
        friction = mass * p.damping_rate * drag / dt
        energy = scale * energy + 0.5 * float((inertia * flight).sum() + (friction * drag).sum())
        return energy, scale * gradient + inertia + friction

    positions, *_ = minimise(
        value, lambda x: find_contacts(model, pose, x), factorised(model, dt), free, start, max_iterations, 1e-3
    )
    velocities = np.zeros_like(positions)
    velocities[free] = (positions[free] - here) / dt
    return State(positions, velocities)
