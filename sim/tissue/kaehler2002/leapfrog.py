# SPDX-License-Identifier: GPL-3.0-or-later
"""The Verlet leapfrog (Kähler et al. 2002, 4.2, after Vesely 1994 and Turner and Gobetti 1998), forward in time and to
rest.

In time: half a kick, a drift, half a kick, so positions and velocities belong to the same moment; damping is an exact
decay in halves round each step. Without damping the scheme runs backwards to where it came from.

To rest: the same scheme as dynamic relaxation (Underwood 1983). Rest does not depend on masses, so each node gets the
mass its stiffness asks for at a time step of 1, and the damping follows the slowest motion seen, by Rayleigh's quotient.
"""

from collections.abc import Callable

import numpy as np

#: The slowest rate believed of, per step squared: a slower motion is a drift along a valley, not a way to rest.
_SLOWEST = 1e-3
#: How many times its least a step may grow before nodes count as running away, and how often masses are doubled then.
_AWAY, _DOUBLINGS = 30.0, 6


class DivergedError(ArithmeticError):
    """Positions left the finite numbers: the time step is too long for the stiffness, or the head is degenerate."""


def require_finite(values, what: str) -> None:
    """Raise `DivergedError` unless all ``values`` (k, 3) are finite numbers."""
    if not np.isfinite(values).all():
        raise DivergedError(
            f"The {what} of the tissue left the finite numbers in {int((~np.isfinite(values)).any(axis=1).sum())} nodes: "
            "shorten the time step or lower the stiffness."
        )


def advance(force: Callable, x, v, mass, dt: float, damping: float = 0.0, steps: int = 1):
    """Positions and velocities (k, 3) after ``steps`` steps of ``dt`` s; force(x, share of the steps done) -> (k, 3).

    mass (k,) g; damping 1/s. Raises `DivergedError` rather than return what is not finite.
    """
    inverse = 1 / mass[:, None]
    keep = np.exp(-0.5 * damping * dt)
    with np.errstate(over="ignore", invalid="ignore"):
        pull = force(x, 0.0) * inverse
        for k in range(steps):
            v = keep * v + 0.5 * dt * pull
            x = x + dt * v
            pull = force(x, (k + 1) / steps) * inverse
            v = keep * (v + 0.5 * dt * pull)
    require_finite(x, "positions")
    require_finite(v, "velocities")
    return x, v


def stable_step(stiffness, mass) -> float:
    """The longest safe ``dt`` (s) for nodes of ``mass`` (k,) g with ``stiffness`` (k,) g/s² about each: 2 / omega, with
    omega² at most 2 K / m (Gershgorin), and a tenth less."""
    return float(0.9 * 2 / np.sqrt((2 * stiffness / mass).max(initial=1e-30)))


def relax(force: Callable, x, stiffness, tolerance: float, max_steps: int, refresh: Callable | None = None):
    """Nodes ``x`` (k, 3) mm brought to rest; returns x, how far they still are from it (mm), steps.

    force(x) -> (k, 3); stiffness (k,) about each node; refresh(x, step) is called before each step and says whether it
    changed the force (contacts). Stops when the largest step left, over the slowest rate seen, is ``tolerance`` mm or
    less. Where springs grow stiffer than they were said to be (``x`` runs away), all masses are doubled and the nodes
    start again from the calmest place.

    Raises
    ------
    DivergedError : they run away however large their mass.
    """
    mass = np.maximum(stiffness, 1e-12)[:, None]
    v = np.zeros_like(x)
    slowest, left, before = 0.02, 0.0, None
    calm, least, doubled = x, np.inf, 0
    for step in range(1, max_steps + 1):
        if refresh is not None and refresh(x, step):
            before = None
        with np.errstate(over="ignore", invalid="ignore"):
            pull = force(x)
            ahead = pull / mass
            size = float(np.sqrt(np.einsum("ij,ij->i", ahead, ahead).max(initial=0.0)))
        if not np.isfinite(size) or size > _AWAY * max(least, 0.1):
            if doubled == _DOUBLINGS:
                require_finite(ahead, "forces")
                raise DivergedError(
                    f"The tissue does not come to rest: after {step} steps it still moves by {size:.3g} mm."
                )
            mass, x, v, before, doubled = 2 * mass, calm, np.zeros_like(x), None, doubled + 1
            least = np.inf
            continue
        if size < least:
            calm, least = x, size
        if before is not None:
            moved = float(np.einsum("ij,ij->", v * mass, v))
            if moved > 0:
                rate = float(np.einsum("ij,ij->", v, before - pull)) / moved
                slowest = 0.7 * slowest + 0.3 * float(np.clip(rate, 1e-4, 1.0))
        left = size / max(slowest, _SLOWEST)
        if left <= tolerance:
            return x, left, step
        before = pull
        drag = 2 * np.sqrt(slowest)
        v = ((2 - drag) * v + 2 * ahead) / (2 + drag)
        x = x + v
    return x, left, max_steps
