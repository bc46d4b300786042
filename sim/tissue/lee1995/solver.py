# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion in time, and poses at rest, by the explicit Euler steps of Lee, Terzopoulos and Waters 1995, 3.9."""

import numpy as np

from ...finite_numbers import require_tolerance
from ..structures import Control, Solution
from .diagnostics import diagnose
from .motion import Barriers, barriers, euler_step
from .posing import Pose, pose_of
from .structures import LeeModel, LeeState

#: Euler steps that count as one iteration; bone and contacts are looked for before each.
STEPS = 10
#: Iterations under the paper's damping, and the share of it that is left after them.
_APPROACH, _LIGHT = 20, 0.25
#: Share of a motion that is left an iteration later, at most, in the judgement of what is still to come.
_SLOWEST = 0.97
#: Iterations before which bone and contacts are looked for again after that: ever more seldom, so that the last settle.
_REFRESH = frozenset((24, 29, 35, 43, 53, 66, 82, 100, 130, 160, 200, 250, 320, 400))
#: mm from its posed rest at which a node is lost.
_LOST = 400.0


class UnstableError(RuntimeError):
    """The explicit steps blew up: the tissue is too stiff for the time step."""


def rest_state(model: LeeModel) -> LeeState:
    """The scan itself, at rest."""
    nodes = model.layers.nodes
    return LeeState(nodes.copy(), np.zeros_like(nodes), nodes.copy())


def step(model: LeeModel, state: LeeState, control: Control, dt: float) -> LeeState:
    """The state ``dt`` seconds later, in as many equal steps as stability asks for.

    Raises
    ------
    UnstableError : a node is lost.
    """
    pose = pose_of(model, control)
    steps = int(np.ceil(dt / model.time_step - 1e-9))
    while steps:
        some = min(steps, STEPS)
        state = advance(model, pose, barriers(model, pose, state.positions), state, dt * some / steps, some)
        dt, steps = dt - dt * some / steps, steps - some
    return state


def advance(
    model: LeeModel, pose: Pose, planes: Barriers, state: LeeState, dt: float, steps: int, damping=None
) -> LeeState:
    """``dt`` seconds in ``steps`` steps; damping in g/s, the paper's by default. Raises `UnstableError`."""
    with np.errstate(all="ignore"):  # what blows up is found below
        for _ in range(steps):
            state = euler_step(model, pose, planes, state, dt / steps, damping)
    farthest = np.abs(state.positions - pose.reference).max(initial=0.0)
    if not farthest < _LOST:
        raise UnstableError(
            f"The explicit steps of {1000 * dt / steps:.3g} ms are too long for this tissue: use a shorter time step."
        )
    return state


def solve(
    model: LeeModel,
    control: Control,
    state: LeeState | None = None,
    *,
    max_iterations: int = 200,
    tolerance: float = 0.02,
) -> Solution:
    """The pose at rest: steps until nothing moves.

    At first with the paper's damping, under which the face comes near to its rest without passing it; then, as damping
    moves no rest but makes the way to it long, with less of it (dynamic relaxation).

    Parameters
    ----------
    state : where to start; by default the posed rest. The jaw and the lids take the tissue of a state along.
    max_iterations : each is `STEPS` steps, 0.1 s of the paper's time
    tolerance : mm still to go at which the pose counts as settled: judged by how far the farthest node moved in one
        iteration, and by how fast that dies away

    Raises
    ------
    InputError : the control or the tolerance is none, or the control was made for another head.
    UnstableError : the steps blow up, and halving them three times does not help.
    """
    require_tolerance(tolerance)
    pose = pose_of(model, control)
    start = rest_state(model) if state is None else state
    begin = LeeState(start.positions + pose.reference - start.reference, np.zeros_like(pose.reference), pose.reference)
    dt = model.time_step
    for _ in range(3):
        try:
            return _settled(model, pose, begin, dt, max_iterations, tolerance)
        except UnstableError:
            dt /= 2
    return _settled(model, pose, begin, dt, max_iterations, tolerance)


def _settled(model, pose, state, dt, max_iterations, tolerance):
    residual, iterations, before = np.inf, 0, np.inf
    for iterations in range(1, max_iterations + 1):
        damping = model.constants.damping * (1.0 if iterations <= _APPROACH else _LIGHT)
        if iterations <= _APPROACH or iterations in _REFRESH:
            planes = barriers(model, pose, state.positions)
        last, state = state, advance(model, pose, planes, state, STEPS * dt, STEPS, damping)
        moved = float(np.sqrt(((state.positions - last.positions) ** 2).sum(axis=1).max(initial=0.0)))
        # a motion that falls by a share each time has moved * share / (1 - share) to go
        share = np.clip(moved / before, 0.5, _SLOWEST) if 0 < before < np.inf else _SLOWEST
        residual, before = moved * share / (1 - share), moved
        if residual <= tolerance:
            break
    return Solution(state, residual <= tolerance, residual, iterations, diagnose(model, pose, state, residual))
