# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of the tissue in time: m a + gamma m v + forces = muscles (Lee, Terzopoulos and Waters 1995, 3.8), implicitly.

A step has two stages, each an implicit Euler step of its own and so the minimum of the energy plus inertia (the singly
diagonally implicit scheme of order two of Alexander 1977, SIAM J. Numer. Anal. 14, 1006): stable at any dt and any
stiffness like implicit Euler, but with little of its artificial damping, so that flesh swings as it should at the frame
rates of films. Both stages share one prefactored matrix; what was learnt about the energy's curvature is kept from step to
step, so that a few quasi-Newton steps are enough.
"""

from dataclasses import dataclass, field, fields, is_dataclass, replace

import numpy as np

from .clearing import cleared
from .curvature import Curvature
from .energy import Pose, find_contacts, load_at, pose_of
from .forces import Landscape
from .planes import Planes
from .solver import descend, factorised, solve
from .structures import Control, Model, State
from .surroundings import Surroundings

#: Where the first stage lies in a step, and the share of the step over which either is implicit.
GAMMA = 1 - np.sqrt(0.5)
#: The last quasi-Newton step of a stage is taken without a look at the energy behind it if no node moves farther, mm.
_TRUST = 0.5
#: What `moving` asks of a stage: quasi-Newton steps at most, and the mm at which fewer do. Its frames are parted into steps
#: of at most this many seconds.
ROUNDS, TOLERANCE, LONGEST = 12, 0.1, 1 / 24


@dataclass(eq=False)
class Memory:
    """What a step leaves to the next of the same dt: what was learnt of the curvature, pose and contacts of its second stage,
    and the mm of its last quasi-Newton step (of all nodes the farthest)."""

    curvature: Curvature = field(default_factory=Curvature)
    pose: Pose | None = None
    planes: Planes | None = None
    residual: float = 0.0


def step(
    model: Model,
    state: State,
    control: Control,
    dt: float,
    *,
    before: Control | None = None,
    memory: Memory | None = None,
    rounds: int = 12,
    tolerance: float = 1e-3,
) -> State:
    """The state ``dt`` seconds later.

    control : at the end of the step
    before : at its beginning; in between, controls change evenly. Without it ``control`` acts all the time.
    memory : kept by the caller from step to step; with it, few ``rounds`` do
    rounds, tolerance : quasi-Newton steps of each stage, and the mm of such a step at which it counts as solved
    """
    memory = Memory() if memory is None else memory
    last = memory.pose
    if last is None and before is not None:
        last = _posed(model, before)
    part = GAMMA * dt
    x, v = state.positions, state.velocities
    between = pose = _posed(model, control)
    middle = control
    if before is not None:
        middle = control_between(before, control, GAMMA)
        # lids go straight for a third of a step: their turn is too short to bend
        between = _posed(model, middle, last.lid_goal + GAMMA * (pose.lid_goal - last.lid_goal))
    # contacts are looked for once a step: the first stage, a third of a step on, has those of the stage before
    start = carried(x, last, between)
    first = _stage(model, middle, between, x, v, start, memory.planes, part, memory, rounds, tolerance)
    velocity = (first - x) / part
    rate = (velocity - v) / part
    ahead = (1 - GAMMA) * dt
    x, v = x + ahead * velocity, v + ahead * rate
    start = carried(first, between, pose)
    second = _stage(model, control, pose, x, v, start, None, part, memory, rounds, tolerance)
    memory.pose = pose
    velocities = np.zeros_like(second)
    free = model.cache["matrix"]["free"]
    velocities[free] = (second[free] - x[free]) / part
    return State(second, velocities)


def moving(model: Model, controls, dt: float, first: State | None = None):
    """Yields the state at every control, ``dt`` seconds apart, and the mm of the last quasi-Newton step there.

    first : the state at the first control; by default the tissue has come to rest there
    """
    memory, before, state = Memory(), None, first
    parts = max(1, int(np.ceil(dt / LONGEST - 1e-6)))
    for control in controls:
        if state is None:
            solution = solve(model, control, max_iterations=200)
            state, memory.residual = solution.state, solution.residual
        elif before is not None:
            for k in range(parts):
                start, end = (control_between(before, control, share / parts) for share in (k, k + 1))
                state = step(
                    model, state, end, dt / parts, before=start, memory=memory, rounds=ROUNDS, tolerance=TOLERANCE
                )
        yield state, memory.residual
        before = control


def cleared_of(model: Model, control: Control, state: State) -> State:
    """``state`` with the drawn skin moved out of what it is still in: for show, as the motion needs it not."""
    return replace(state, positions=cleared(model, _posed(model, control), state.positions))


def _stage(model, control, pose, here, velocity, start, planes, dt, memory, rounds, tolerance):
    """(3 n, 3) mm: the nodes after an implicit Euler step of ``dt`` from ``here`` with ``velocity``. Contacts are looked for
    where no ``planes`` are given."""
    free, p = model.cache["matrix"]["free"], model.parameters
    if not control.around.idle:
        pose = replace(pose, load=load_at(model, control.around, start, velocity))
    if planes is None:
        at = pose.reference.copy()
        at[free] = start[free]
        planes = memory.planes = find_contacts(model, pose, at)
    landscape = Landscape(model, pose, planes)
    mass = model.mass[free] / p.dynamic_scale
    heavy, drag = mass / dt**2, mass * p.damping_rate / dt
    # inertia pulls towards where the node would fly to, drag to where it is: both together to a place between
    pull = heavy + drag
    goal = landscape.free(here) + heavy * dt / pull * landscape.free(velocity)

    def value(q):
        energy, gradient = landscape(q)
        off = q - goal
        inertia = pull * off
        return energy + 0.5 * float(np.vdot(inertia, off)), gradient + inertia

    q = landscape.free(start)
    q, _, memory.residual, _ = descend(value, factorised(model, dt), q, memory.curvature, rounds, tolerance, _TRUST)
    return landscape.positions(q)


def _posed(model, control, lid_goal=None):
    """The pose of a control, without what acts from outside: that depends on where the nodes are."""
    inner = control if control.around.idle else replace(control, around=Surroundings())
    return pose_of(model, inner, lid_goal)


def carried(positions, before: Pose | None, after: Pose) -> np.ndarray:
    """(3 n, 3) mm: nodes as they lay in the pose ``before``, taken along by the jaw and the lids to the pose ``after``."""
    if before is None:
        return positions
    out = positions + (after.reference - before.reference)
    out[after.lid_node] = positions[after.lid_node] + (after.lid_goal - before.lid_goal)
    return out


def control_between(one, other, share: float):
    """The control (or what it holds) ``share`` of the way from ``one`` to ``other``."""
    if share in (0, 1):
        return other if share else one
    if is_dataclass(one):
        parts = {f.name: control_between(getattr(one, f.name), getattr(other, f.name), share) for f in fields(one)}
        return replace(other, **parts)
    return one if one is other else (1 - share) * np.asarray(one, float) + share * np.asarray(other, float)
