# SPDX-License-Identifier: GPL-3.0-or-later
"""How the time of a frame grows with the mesh, and with the springs on the same mesh."""

from dataclasses import replace

import numpy as np
from tissue_clip import Clock, clip
from tissue_explicit import measured
from tissue_meshes import resized
from tissue_models import at_rest, in_motion

from headshop.sim.tissue.energy import system_matrix
from headshop.sim.tissue.model import build_model
from headshop.sim.tissue.solver import solve
from headshop.sim.tissue.springs import assemble


def meshes(head, sizes, frames: int):
    """Yields a row for each size of skin, in shares of the reference head's: the whole smile on each."""
    for times in sizes:
        smaller = resized(head, times)
        with Clock() as building:
            model = build_model(smaller)
        yield {
            "times": times,
            "build_cpu_s": building.cpu,
            **_row(model, frames if times <= 2 else max(frames // 2, 1)),
        }


def springs(model, shares, frames: int):
    """Yields a row for each number of springs: every one of them parted into so many of its stiffness's part side by side,
    so that the same face moves alike."""
    for share in shares:
        yield {"times": share, **_row(parted(model, share), frames)}


def parted(model, share: int):
    """``model`` with ``share`` times as many springs that do the same."""
    old = model.springs
    first, second, kind, stiffness, stiff, limit = (
        np.repeat(getattr(old, name), share) for name in ("first", "second", "kind", "stiffness", "stiff", "limit")
    )
    new = assemble(model.layers.nodes, first, second, kind, stiffness / share, stiff / share, limit)
    out = replace(model, springs=new, cache={})
    out.cache["matrix"] = system_matrix(out)
    return out


def _row(model, frames):
    still = at_rest("headshop", model, frames)
    moved = in_motion("headshop", model, frames)
    controls = clip(model, 2, shaken=True)
    explicit = measured(model, solve(model, controls[0]).state, controls, most=60)
    return {
        "vertices": model.count,
        "springs": len(model.springs.rest),
        "rest_cpu_s": still["cpu_s"],
        "rest_error_mm": still["error_mm"],
        "motion_cpu_s": moved["cpu_s"],
        "motion_error_mm": moved["error_mm"],
        "explicit_cpu_s": explicit["cpu_s"],
        "explicit_steps": explicit["steps"],
    }
