# SPDX-License-Identifier: GPL-3.0-or-later
"""Rest positions of the tissue; `dynamics` moves it in time.

`solve` minimises the energy: quasi-Newton steps (L-BFGS, `curvature`) on the prefactored matrix of the springs at rest (as
in projective dynamics, Liu et al. 2017), with a guarded line search.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from ..finite_numbers import require_tolerance
from .clearing import cleared
from .curvature import Curvature
from .diagnostics import diagnose
from .dissection import Dissection, parted
from .energy import find_contacts, pose_of, posed_reference
from .forces import Landscape
from .structures import Control, Model, Solution, State

#: Free nodes up to which dense blocks are faster than sparse triangles.
LARGEST = 6000
#: Steps after which contacts are looked for again: ever more seldom, so that the last planes are solved to the end.
_REFRESH = frozenset((4, 8, 13, 19, 27, 38, 53, 75, 105, 150))


def rest_state(model: Model) -> State:
    """The scan itself, at rest."""
    return State(model.layers.nodes.copy(), np.zeros_like(model.layers.nodes))


def solve(
    model: Model, control: Control, state: State | None = None, *, max_iterations: int = 60, tolerance: float = 0.01
) -> Solution:
    """The pose at rest.

    state : where to start (a pose near by makes it fast); the rest by default.
    tolerance : mm; the largest remaining quasi-Newton step at which the pose counts as settled.

    Raises
    ------
    InputError : the control or the tolerance is none, or the control was made for another head.
    """
    require_tolerance(tolerance)
    pose = pose_of(model, control)
    if state is not None:
        start = _carried_along(model, state, pose)
    else:
        start = pose.reference.copy()
        at = np.flatnonzero(model.layers.free[pose.lid_node])
        start[pose.lid_node[at]] = pose.lid_goal[at]
    positions, energy, residual, iterations, planes = minimise(
        lambda planes: Landscape(model, pose, planes),
        lambda x: find_contacts(model, pose, x),
        factorised(model),
        start,
        max_iterations,
        tolerance,
    )
    positions = cleared(model, pose, positions)
    result = State(positions, np.zeros_like(positions))
    report = diagnose(model, pose, positions, energy, residual)
    return Solution(result, residual <= tolerance, residual, iterations, report)


def _carried_along(model: Model, state: State, pose) -> np.ndarray:
    """(3 n, 3) mm: the nodes of ``state`` as a start for ``pose``: moved along with the jaw, bone and what is not free in
    its place."""
    start = pose.reference.copy()
    free = model.cache["matrix"]["free"]
    start[: 2 * model.count] = state.positions[: 2 * model.count]
    start = _carry_jaw(model, state, pose, start)
    out = pose.reference.copy()
    out[free] = start[free]
    return out


def _carry_jaw(model, state, pose, start):
    """Move a warm start along with the jaw: keep each node's offset from its posed rest."""
    n = model.count
    bones = state.positions[2 * n :]
    if np.abs(bones - pose.reference[2 * n :]).max() < 1e-9:
        return start
    before = _reference_of(model, bones)
    start[: 2 * n] += (pose.reference - before)[: 2 * n]
    return start


def _reference_of(model, bones):
    """The posed rest that belongs to bone nodes ``bones`` (n, 3): the rigid motion of the mandible, fitted to them."""
    layers = model.layers
    n = model.count
    rest = layers.nodes[2 * n :]
    share = layers.mandible
    rows = np.flatnonzero(share > 0.999)
    if len(rows) < 3:
        return layers.nodes
    a, b = rest[rows], bones[rows]
    ca, cb = a.mean(axis=0), b.mean(axis=0)
    u, _, vt = np.linalg.svd((b - cb).T @ (a - ca))
    rotation = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt
    return posed_reference(model, rotation, cb - rotation @ ca)


def factorised(model: Model, dt: float | None = None):
    """The solver matrix, with inertia and damping for a time step, ready to ``solve``; the last few are kept."""
    kept = model.cache.setdefault("factors", {})
    if dt not in kept:
        fixed = model.cache["matrix"]
        matrix, free = fixed["system"], fixed["free"]
        if dt is not None:
            p = model.parameters
            inertia = model.mass[free] * (1 / dt**2 + p.damping_rate / dt)
            matrix = matrix + sparse.diags(inertia / p.dynamic_scale)
        while len(kept) > 3:
            kept.pop(next(iter(kept)))
        if len(free) > LARGEST:
            kept[dt] = splu(
                matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0
            )
        else:
            if "parts" not in fixed:
                fixed["parts"] = parted(matrix, model.layers.nodes[free])
            kept[dt] = Dissection(matrix, *fixed["parts"])
    return kept[dt]


def minimise(value, contacts, factor, positions, max_iterations, tolerance, curvature=None, trust=0.0):
    """Quasi-Newton descent; returns positions, energy, residual (mm), iterations and the last contact planes.

    value : contact planes -> `Landscape`; contacts : positions -> planes; curvature, trust : as in `descend`
    """
    curvature = Curvature() if curvature is None else curvature
    residual, done, planes, energy = np.inf, 0, contacts(positions), 0.0
    for until in (*sorted(k for k in _REFRESH if k < max_iterations), max_iterations):
        at = value(planes)
        q, energy, residual, steps = descend(at, factor, at.free(positions), curvature, until - done, tolerance, trust)
        positions = at.positions(q)
        done += steps
        if residual <= tolerance or done < until or until == max_iterations:
            break
        planes = contacts(positions)
    return positions, energy, residual, done, planes


def descend(value, factor, q, curvature, steps, tolerance=0.0, trust=0.0):
    """At most ``steps`` quasi-Newton steps from ``q`` (3, m) mm; returns where they end, the energy, the residual (mm) and
    the number of steps.

    value : q -> energy and its gradient (3, m)
    curvature : `Curvature`, what is known of it; is added to
    trust : mm; a last step no longer than this is taken without a look at the energy behind it
    """
    energy, gradient = value(q)
    solved = factor.solve(gradient.T).T
    residual = np.inf
    for count in range(1, steps + 1):
        direction = -curvature.applied(gradient, solved)
        slope = float(np.vdot(direction, gradient))
        if slope >= 0:  # a stale memory: fall back to the matrix alone
            curvature.clear()
            direction = -solved
            slope = float(np.vdot(direction, gradient))
        residual = float(np.sqrt(np.einsum("ij,ij->j", direction, direction).max(initial=0.0)))
        if residual <= tolerance or (count == steps and residual <= trust):
            return q + direction if trust else q, energy, residual, count
        length = min(1.0, 15.0 / residual)  # no node jumps farther than this in one step
        rounding = np.finfo(gradient.dtype).eps * abs(energy)
        for _ in range(12):
            moved = q + length * direction
            new_energy, new_gradient = value(moved)
            if new_energy <= energy + 1e-4 * length * slope + rounding:
                break
            # the minimum of the parabola through both energies and the slope
            curve = new_energy - energy - length * slope
            length *= float(np.clip(-0.5 * length * slope / max(curve, 1e-30), 0.1, 0.6))
        else:
            if not len(curvature):
                return q, energy, residual, count
            curvature.clear()
            continue
        new_solved = factor.solve(new_gradient.T).T
        curvature.add(length * direction, new_gradient - gradient, new_solved - solved)
        q, energy, gradient, solved = moved, new_energy, new_gradient, new_solved
    return q, energy, residual, steps
