# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames a second of every model that can act, at rest in each frame and in motion, as the tissue gets stiffer."""

from itertools import pairwise

import numpy as np
from tissue_clip import FRAME, Clock, clip, root_mean_square, stiffer, stiffer_lee

from headshop.sim.acting.models import model_named
from headshop.sim.tissue.dynamics import GAMMA, Memory, control_between, moving, step
from headshop.sim.tissue.frames import Frames
from headshop.sim.tissue.kaehler2002.solver import step as kaehler_step
from headshop.sim.tissue.lee1995.model import build_model as build_lee
from headshop.sim.tissue.lee1995.solver import step as lee_step
from headshop.sim.tissue.solver import factorised

BAKE = 60  # iterations that a bake gives a frame that begins where the one before ended
#: Frames followed by the models that take long.
SLOW = 2
#: What counts as solved: iterations at most, and mm of the last step.
EXACT = {"max_iterations": 300, "tolerance": 1e-3}


def at_rest(name: str, model, frames: int) -> dict:
    """A clip, each frame from the one before: the first is not counted. Error: of the skin against the same model's rest
    found to 0.001 mm from there (root mean square of all frames, and the worst frame's)."""
    acting = model_named(name)
    controls = clip(model, frames + 1)
    follow = _follower(name, model, acting)
    follow(controls[0])
    cpu, elapsed, errors = [], [], []
    for asked in controls[1:]:
        with Clock() as clock:
            state = follow(asked)
        cpu.append(clock.cpu)
        elapsed.append(clock.elapsed)
        if name == "headshop":
            exact = acting.solve(model, asked, state, **EXACT)
            errors.append(root_mean_square(state.skin, exact.state.skin))
    cost = {"cpu_s": float(np.mean(cpu)), "elapsed_s": float(np.mean(elapsed)), "frames": frames}
    return cost | _errors(errors)


def _follower(name, model, acting):
    if name == "headshop":
        frames = Frames(model)
        frames.follow(clip(model, 1)[0], steps=BAKE)  # comes to the clip's first frame from rest
        return frames.follow
    kept = [None]

    def follow(asked):
        kept[0] = acting.solve(model, asked, kept[0], max_iterations=BAKE).state
        return kept[0]

    return follow


def _errors(each) -> dict:
    """Of frames' root mean squares: theirs together, and the worst."""
    return {"error_mm": float(np.sqrt(np.mean(np.square(each)))), "worst_mm": max(each)} if each else {}


def in_motion(name: str, model, frames: int) -> dict:
    """The same clip in time, with our own model on a head that is shaken. Error: against the same steps solved tightly."""
    controls = clip(model, frames + 1, shaken=name == "headshop")
    acting = model_named(name)
    first = acting.solve(model, controls[0]).state
    errors = {}
    if name == "headshop":
        factorised(model, GAMMA * FRAME)  # once a model, not a frame
        states = moving(model, controls, FRAME, first)
        next(states)
        with Clock() as clock:
            path = [state.skin for state, _ in states]
        exact = tight(model, controls, first)
        errors = _errors([root_mean_square(*pair) for pair in zip(path, exact, strict=True)])
    else:
        steps = {"lee": lee_step, "kaehler": kaehler_step}[name]
        state = steps(model, first, controls[0], FRAME)
        with Clock() as clock:
            for asked in controls[1:]:
                state = steps(model, state, asked, FRAME)
    return {"cpu_s": clock.cpu / frames, "elapsed_s": clock.elapsed / frames, "frames": frames, **errors}


def tight(model, controls, state, parts: int = 1) -> list:
    """The skin at the end of every frame after the first, with ``parts`` steps a frame, each solved to 1e-4 mm."""
    memory, path = Memory(), []
    for before, asked in pairwise(controls):
        for k in range(parts):
            begin, end = (control_between(before, asked, share / parts) for share in (k, k + 1))
            limits = {"before": begin, "memory": memory, "rounds": 100, "tolerance": 1e-4}
            state = step(model, state, end, FRAME / parts, **limits)
        path.append(state.skin)
    return path


def rows(head, own, stiffness, frames: int):
    """Yields a row for each model, kind of motion and stiffness; ``own``: our model of ``head``."""
    waters = model_named("waters").build(head)
    kaehler = model_named("kaehler").build(head)
    for factor in stiffness:
        lee = build_lee(head, stiffer_lee(factor))
        ours, theirs = stiffer(own, factor), stiffer(kaehler, factor)
        cases = (
            ("waters", "at rest", waters, at_rest, 4 * frames),
            ("lee", "at rest", lee, at_rest, 1),
            ("kaehler", "at rest", theirs, at_rest, SLOW),
            ("headshop", "at rest", ours, at_rest, frames),
            ("lee", "in motion", lee, in_motion, SLOW),
            ("kaehler", "in motion", theirs, in_motion, SLOW),
            ("headshop", "in motion", ours, in_motion, frames),
        )
        for name, kind, model, measure, count in cases:
            yield {"model": name, "kind": kind, "stiffness": factor, **measure(name, model, count)}
