# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas that may become driven shape keys: all that the response of a face can bend with, by name."""

import numpy as np

from ..anatomy.head import JAW_PARTS
from .formula import Formula, most, of, tent
from .quantities import quantities, sliders
from .rig import Rig

#: Places on the way of jaw and lids where a key of its own may stand.
STEPS = (0.0, 0.15, 0.35, 0.6, 0.8, 1.0)
#: mm by which both of two quantities must move some vertex for their product to be tried.
_MEET = 0.5
#: What is drawn before the name of a driven key.
MARK = "~"


def candidates(rig: Rig, part: str, alone: np.ndarray) -> dict[str, Formula]:
    """Name of a key -> its formula, for a part whose vertices move by ``alone`` (s, n, 3) mm with each slider alone at 1."""
    found: dict[str, Formula] = {}
    if part == "skin":
        found = _of_jaw() | _of_lids() | _of_muscles(rig) | _products(rig, alone)
    elif part in JAW_PARTS:
        found = _of_jaw() | {f"{a}*{b}": of(a) * of(b) for a, b in (("forward", "aside"), ("forward", "opening"))}
        found |= {"aside*opening*2": of("aside") * of("opening") * of("opening"), "tongue_out*opening": _tongue()}
        found |= {"aside*opening": of("aside") * of("opening"), "forward*opening*2": of("forward") * _square("opening")}
    elif part.startswith("eye_"):
        found = _of_gaze(part[-1])
    return {MARK + name: formula for name, formula in found.items()}


def _square(name: str) -> Formula:
    return of(name) * of(name)


def _tongue() -> Formula:
    return of("tongue_out") * of("opening")


def _of_jaw() -> dict[str, Formula]:
    """What is beyond straight lines in the jaw's three motions."""
    found = {"opening": of("opening") - of("jaw_open"), "forward": of("forward") - of("jaw_forward")}
    found["aside"] = of("aside") - of("jaw_side")
    for left, top, right in zip(STEPS, STEPS[1:], STEPS[2:], strict=False):
        found[f"opening {top:g}"] = tent(of("opening"), left, top, right)
    found["back"] = most(of("forward") * -1.0, 0.0)
    found["forward 2"] = most(of("forward"), 0.0) * most(of("forward"), 0.0)
    found["right"] = most(of("aside") * -1.0, 0.0)
    found["left 2"] = most(of("aside"), 0.0) * most(of("aside"), 0.0)
    found["right 2"] = most(of("aside") * -1.0, 0.0) * most(of("aside") * -1.0, 0.0)
    return found


def _of_lids() -> dict[str, Formula]:
    found = {}
    for side in "lr":
        for lid in ("upper", "lower"):
            name = f"lid {lid} {side}"
            found[name] = of(name) - of(f"blink_{side}")
            found[f"{name} wide"] = most(of(name) * -1.0, 0.0)
            for left, top, right in zip(STEPS, STEPS[1:], STEPS[2:], strict=False):
                found[f"{name} {top:g}"] = tent(of(name), left, top, right)
        found |= _of_gaze(side)
        found[f"gaze {side} x left"] = most(of(f"gaze {side} x"), 0.0)
        for lid in (f"lid upper {side}", f"lid lower {side}"):
            for look in (f"gaze {side} x", f"gaze {side} z"):
                found |= {f"{look}*{lid}": of(look) * of(lid), f"{look} 2*{lid}": _square(look) * of(lid)}
    return found


def _of_gaze(side: str) -> dict[str, Formula]:
    x, z = f"gaze {side} x", f"gaze {side} z"
    found = {x: of(x) - of("gaze_x") - of(f"gaze_{side}_x"), z: of(z) - of("gaze_z") - of(f"gaze_{side}_z")}
    found |= {f"{x} 2": _square(x), f"{z} 2": _square(z), f"{x}*{z}": of(x) * of(z)}
    found |= {f"{x} 3": _square(x) * of(x), f"{z} 3": _square(z) * of(z), f"{z} down": most(of(z) * -1.0, 0.0)}
    return found | {f"{x} 2*{z}": _square(x) * of(z), f"{x}*{z} 2": _square(z) * of(x)}


def _of_muscles(rig: Rig) -> dict[str, Formula]:
    """Forces beyond their sliders, and what the lips' centres, the seal and the cheeks do besides."""
    found = {}
    for name in quantities(rig):
        if name.endswith(" force"):
            muscle = name.removesuffix(" force")
            found[muscle] = of(name) - of(muscle)
            found[f"{muscle} 2"] = of(name) * (of(name) - of(muscle))
            found[f"{muscle} part"] = of(muscle) * (1.0 - of(muscle))
        elif name.endswith(" held"):
            found[name], found[f"{name} 2"] = of(name), _square(name)
            found[f"{name} back"] = most(of(name) * -1.0, 0.0)
    for name in ("cheek_puff", "lips_together"):
        found[f"{name} 2"] = _square(name)
    found["cheek_puff in"] = most(of("cheek_puff") * -1.0, 0.0)
    for left, top, right in zip(STEPS, STEPS[1:], (*STEPS[2:], 2.0), strict=False):
        found[f"lips_together*opening {top:g}"] = of("lips_together") * tent(of("opening"), left, top, right)
    return found


def _products(rig: Rig, alone: np.ndarray) -> dict[str, Formula]:
    """Pairs of quantities that move the same skin."""
    moved = dict(zip(sliders(rig), np.linalg.norm(alone, axis=2), strict=True))
    reach = {f"{name} force": moved[name] for name in rig.muscle_names if f"{name} force" in quantities(rig)}
    for lip in ("upper", "lower"):
        if f"lip_{lip}_forward held" in quantities(rig):
            reach[f"lip_{lip}_forward held"] = moved[f"orbicularis_oris_{lip}"]
    reach |= {"opening": moved["jaw_open"], "aside": moved["jaw_side"], "forward": moved["jaw_forward"]}
    reach |= {"cheek_puff": moved["cheek_puff"], "lips_together": moved["jaw_open"]}
    reach |= {f"lid {lid} {side}": moved[f"blink_{side}"] for side in "lr" for lid in ("upper", "lower")}
    names = list(reach)
    pairs = ((a, b) for k, a in enumerate(names) for b in names[k + 1 :])
    return {f"{_short(a)}*{_short(b)}": of(a) * of(b) for a, b in pairs if np.minimum(reach[a], reach[b]).max() > _MEET}


def _short(name: str) -> str:
    return name.removesuffix(" force").removesuffix(" held")
