# SPDX-License-Identifier: GPL-3.0-or-later
"""Rest positions and motion by the leapfrog (Kähler et al. 2002, 4.2).

Muscle contraction is prescribed: the axes come to rest among themselves, and carry the feet of the skin; what skin does
to muscle is left out, as in the paper. In `step` the feet go to where the control wants them evenly within the step.
"""

import numpy as np

from ...finite_numbers import require_tolerance
from ..eye_surface import depth_in_eyeballs
from ..planes import Planes, depths, project
from ..structures import Control, Solution, State
from .forces import contact_stiffness, energy_gradient, find_contacts, stiffness_at
from .leapfrog import advance, relax, require_finite, stable_step
from .posed import Pose, pose_of
from .skull import heights
from .structures import Model
from .volume import prism_volumes

#: Leapfrog steps for one iteration of a caller who counts in iterations of an implicit solver.
_STEPS = 8
#: Times that skin is taken out of what it may still be in, by contacts found anew.
_PASSES = 3
#: Steps after which contacts are looked for again.
_REFRESH = frozenset((1, 10, 25, 45, 70, 100, 140, 190, 250, 330, 430, 560, 730, 950, 1200))


def rest_state(model: Model) -> State:
    """The scan itself, at rest."""
    return State(model.rest.copy(), np.zeros_like(model.rest))


def solve(
    model: Model, control: Control, state: State | None = None, *, max_iterations: int = 200, tolerance: float = 0.01
) -> Solution:
    """The pose at rest, by leapfrog steps with the masses that bring it there soonest.

    state : where to start (a pose near by makes it fast); the rest by default
    max_iterations : each is worth 8 steps; tolerance : mm that the skin may still be from rest

    Raises
    ------
    InputError : the control or the tolerance is none, or the control was made for another head.
    DivergedError : positions left the finite numbers.
    """
    require_tolerance(tolerance)
    pose = pose_of(model, control)
    require_finite(pose.nodes, "attachments")
    n = model.count
    free = np.flatnonzero(model.free)
    before = rest_state(model) if state is None else state
    x = pose.nodes.copy()
    # skin goes with its feet first
    x[free] = before.positions[free] + (pose.nodes - before.positions)[n : 2 * n][free]
    x[pose.lid_node] = pose.lid_goal
    held = {}

    def refresh(_, step):
        if step not in _REFRESH:
            return False
        held["planes"] = find_contacts(model, pose, x[:n])
        return step > 1

    def force(skin):
        x[free] = skin
        return -energy_gradient(model, pose, held["planes"], x)[1][free]

    refresh(x, 1)
    about = (stiffness_at(model, x) + contact_stiffness(model, held["planes"]))[free]
    skin, residual, steps = relax(force, x[free], about, tolerance, _STEPS * max_iterations, refresh)
    x[free] = skin
    for _ in range(_PASSES):
        planes = find_contacts(model, pose, x[:n])
        x = project(planes, x, rounds=4)
    result = State(x, np.zeros_like(x))
    return Solution(result, residual <= tolerance, residual, steps, diagnose(model, pose, planes, x, residual))


def step(model: Model, state: State, control: Control, dt: float) -> State:
    """The state ``dt`` seconds later: m a = forces - gamma m v, in as many leapfrog steps as stability asks for."""
    pose = pose_of(model, control)
    require_finite(pose.nodes, "attachments")
    n, p = model.count, model.parameters
    free = np.flatnonzero(model.free)
    x = state.positions.copy()
    fixed = np.setdiff1d(np.arange(3 * n), free)
    start, end = x[fixed], pose.nodes[fixed]
    planes = find_contacts(model, pose, x[:n])
    about = stiffness_at(model, x) + contact_stiffness(model, planes)
    steps = max(1, int(np.ceil(dt / stable_step(p.dynamic_scale * about[free], model.mass[free]))))

    def force(skin, done):
        x[free] = skin
        x[fixed] = start + done * (end - start)
        return -p.dynamic_scale * energy_gradient(model, pose, planes, x)[1][free]

    skin, v = advance(force, x[free], state.velocities[free], model.mass[free], dt / steps, p.damping_rate, steps)
    x[free], x[fixed] = skin, end
    velocities = np.zeros_like(x)
    velocities[free] = v
    return State(x, velocities)


def diagnose(model: Model, pose: Pose, planes: Planes, positions, residual: float) -> dict:
    """residual mm, energy, volume_drift (share), penetration_mm (skin with eyeballs, teeth, lips), bone_penetration_mm,
    inverted_prisms, peak_mm (largest motion of the skin)."""
    n = model.count
    volume = prism_volumes(positions, model.prisms) if len(model.prisms) else np.ones(1)
    rest = model.prism_volume if len(model.prisms) else np.ones(1)
    energy, _ = energy_gradient(model, pose, planes, positions)
    eye = depth_in_eyeballs(model.lids, positions, lambda side: pose.gaze["lr".index(side)])
    deepest = max(depths(planes, positions).max(initial=0.0), eye)
    height, _ = heights(positions, model.skull, pose.rotation, pose.translation)
    return {
        "residual": float(residual),
        "energy": float(energy),
        "volume_drift": float(volume.sum() / rest.sum() - 1),
        "penetration_mm": float(deepest),
        "bone_penetration_mm": float(np.maximum(-height, 0).max(initial=0.0)),
        "inverted_prisms": int((volume <= 0).sum()),
        "peak_mm": float(np.linalg.norm(positions[:n] - model.rest[:n], axis=1).max(initial=0.0)),
    }
