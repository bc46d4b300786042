# SPDX-License-Identifier: GPL-3.0-or-later
"""What a pose's sliders ask for, as formulas: `pose.control` and `spending` again, in a driver's words.

A quantity is made of sliders and of quantities before it. A muscle's force is that of `Spending.forces` after one round:
what the others have done is taken from the force that each would have left alone.
"""

import numpy as np

from ..acting.pose import CONTROLS, JAW_WORK, LID_WORK, SIDE_WORK
from ..tissue.muscle_field import LIPS
from .formula import LONGEST, Formula, clipped, most, of, weighted
from .inputs import OTHERS, pulling
from .rig import Rig

#: What counts in a muscle's force: progress by another muscle or input at its most, shares of the reach.
_COUNTS = 0.03
#: Muscles and inputs that a driver can hold beside its own.
_MATES = 7


def quantities(rig: Rig) -> dict[str, Formula]:
    """Name -> formula, each after what it needs: the jaw, gaze, lids, then what is left of each muscle's force."""
    names = set(rig.muscle_names)
    out: dict[str, Formula] = {}

    def muscle(base, side):
        return f"{base}_{side}" if f"{base}_{side}" in names else None

    def both(share_of):
        pairs = [(muscle(base, side), share_of(base) / 2) for base in JAW_WORK for side in "lr"]
        return {name: share for name, share in pairs if name and share}

    opening = {"jaw_open": 1.0, **both(lambda base: max(JAW_WORK[base][0], 0.0))}
    closing = both(lambda base: min(JAW_WORK[base][0], 0.0))
    out["opening asked"] = weighted(opening)
    asked = of("opening asked")
    out["opening"] = clipped(asked + weighted(closing) * most(asked, 0.0) if closing else asked, 0.0, 1.0)
    ahead = {"jaw_forward": 1.0, **both(lambda base: JAW_WORK[base][1])}
    out["forward"] = clipped(weighted(ahead), -1.0, 1.0)
    away = {"l": -SIDE_WORK, "r": SIDE_WORK}
    aside = {muscle("pterygoideus_lateralis", side): share for side, share in away.items()}
    out["aside"] = clipped(weighted({"jaw_side": 1.0, **{k: v for k, v in aside.items() if k}}), -1.0, 1.0)
    for side in "lr":
        for axis in "xz":
            out[f"gaze {side} {axis}"] = clipped(weighted({f"gaze_{axis}": 1.0, f"gaze_{side}_{axis}": 1.0}), -1.0, 1.0)
        for row, lid in enumerate(("upper", "lower")):
            work = {muscle(base, side): share[row] for base, share in LID_WORK.items() if share[row]}
            others = weighted({k: v for k, v in work.items() if k})
            out[f"lid {lid} {side}"] = others * (1.0 - of(f"blink_{side}")) + of(f"blink_{side}")
    out |= _forces(rig)
    for lip, (name, muscle_name) in enumerate(zip(("lip_upper_forward", "lip_lower_forward"), LIPS, strict=True)):
        if rig.sphincters[lip] >= 0:
            out[f"{name} held"] = of(name) * of(f"{muscle_name} force")
    return out


def _forces(rig: Rig) -> dict[str, Formula]:
    """``alone`` and ``force`` of every muscle whose force is spent by its own work or that of others."""
    spending, names = rig.spending, pulling(rig.muscle_names)
    mutual, own = spending.mutual, np.diag(spending.mutual)
    full = 1 / (1 + own)  # of each muscle alone, fully contracted
    inputs = dict(
        zip(OTHERS, ("opening", "forward", "aside", *[""] * 8, "", "", "lips_together", "cheek_puff"), strict=True)
    )
    alone = {f"{name} alone": of(name) / (of(name) * own[k] + 1.0) for k, name in enumerate(names)}
    out = {}
    for k, name in enumerate(names):
        mates = {f"{mate} alone": mutual[k, j] for j, mate in enumerate(names) if j != k and mutual[k, j] * full[j]}
        strength = {f"{mate} alone": abs(mutual[k, j]) * full[j] for j, mate in enumerate(names)}
        for j, other in enumerate(OTHERS):
            if inputs[other]:
                mates[inputs[other]] = spending.beside[k, j]
                strength[inputs[other]] = abs(spending.beside[k, j])
        strongest = [each for each in sorted(mates, key=lambda each: -strength[each]) if strength[each] > _COUNTS]
        left = 1.0 - weighted({each: mates[each] for each in strongest[:_MATES]}) if strongest else None
        force = of(f"{name} alone") * (1 + own[k])
        out[f"{name} force"] = force if left is None else force * most(left, 0.0)
    return alone | out


def sliders(rig: Rig) -> tuple[str, ...]:
    """Every channel of a pose: muscles, then controls."""
    return (*rig.muscle_names, *CONTROLS)


def values_of(formulas: dict[str, Formula], sliders: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The sliders (f,) and all quantities (f,) made of them."""
    known = dict(sliders)
    shape = np.shape(next(iter(sliders.values())))
    for name, formula in formulas.items():
        known[name] = np.broadcast_to(formula.value(known), shape)
    return known


def letters(formula: Formula) -> dict[str, str]:
    """A letter for each quantity that a formula uses."""
    found = {name: chr(97 + k) for k, name in enumerate(formula.names())}
    assert len(formula.text(found)) <= LONGEST, formula.text(found)
    return found
