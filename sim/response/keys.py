# SPDX-License-Identifier: GPL-3.0-or-later
"""The rig as shape keys: one for each slider, and driven ones that bend the sum of them to what the simulation does.

A slider's key is the response to it alone at 1; the jaw's muscles have none, they move the jaw. What is missing is
fitted with formulas of the sliders (`quantities`): a muscle's force beyond its slider, steps of jaw and lids on their
way, and products of two quantities that move the same skin. Out of all these the ones that explain most are taken one
by one (orthogonal least squares: Chen, Billings and Luo 1989), on poses that the rig plays. What is left of a small motion
weighs more than as much of a large one: a hundred keys cannot follow extremes, and must not spoil a smile for them.
"""

import re
from dataclasses import dataclass

import numpy as np

from ..progress import Progress, Work, portion
from ..tissue.muscle_field import JAW_MUSCLES, base_name
from .candidates import MARK, candidates
from .formula import Formula
from .quantities import quantities, sliders, values_of

#: Driven keys of the skin at most, and of a part that moves rigidly.
DRIVEN, DRIVEN_OF_A_PART = 200, 18
#: mm rms over a part: no more keys are added once this little is left; mm that a key must move anything by at its most.
_ENOUGH, _SEEN = 0.02, 0.02
#: Ridge of the last fit, a share of each column's own square; principal directions that the choice looks at.
_RIDGE, _DIRECTIONS = 1e-4, 100
#: A pose weighs as one over its motion beyond the sliders (mm rms and this) to this power.
_SMALL, _LESS = 0.2, 0.8
#: Lids, within so many radii of an eye's centre, weigh more in the choice: an eyeball shows through them at once.
_LIDS, _CLOSELY = 1.35, 4.0


@dataclass(frozen=True, eq=False)
class PartKeys:
    """Keys of one part: ``plain`` slider -> displacements (n, 3) mm at 1; ``driven`` name -> (formula, displacements)."""

    plain: dict[str, np.ndarray]
    driven: dict[str, tuple[Formula, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Keys:
    """What is baked: ``sliders`` name -> lowest value; ``quantities`` in the order of their needs; part -> `PartKeys`."""

    sliders: dict[str, float]
    quantities: dict[str, Formula]
    parts: dict[str, PartKeys]

    def displacement(self, part: str, values: dict[str, float]) -> np.ndarray:
        """(n, 3) mm of a part with the sliders named at ``values`` and all others at 0: what Blender will show."""
        found = self.parts[part]
        at = {name: np.array([values.get(name, 0.0)]) for name in self.sliders}
        known = values_of(self.quantities, at)
        out = sum(shape * at[name] for name, shape in found.plain.items())
        return out + sum(shape * float(formula.value(known)[0]) for formula, shape in found.driven.values())


def chosen_keys(rig, poses, played, lowest: dict[str, float], eyes=()) -> Work:
    """`Keys` from poses (a dict of channel values each) and ``played``: part -> displacements (f, n, 3) mm in them.

    The first poses are every slider alone at 1, in the order of `quantities.sliders`. lowest: slider -> least value;
    eyes: of the head
    """
    names = sliders(rig)
    at = {name: np.array([values.get(name, 0.0) for values in poses]) for name in names}
    formulas = quantities(rig)
    known = values_of(formulas, at)
    parts, used = {}, set()
    for number, (part, motion) in enumerate(played.items()):
        start, stop = number / len(played), (number + 1) / len(played)
        ends = motion[: len(names)].reshape(len(names), -1).copy()
        ends[[base_name(name) in JAW_MUSCLES for name in names]] = 0.0  # they move the jaw, and it does the rest
        left = motion.reshape(len(motion), -1) - np.stack([at[name] for name in names], axis=1) @ ends
        most = DRIVEN if part == "skin" else DRIVEN_OF_A_PART
        options = candidates(rig, part, motion[: len(names)])
        columns = np.stack([formula.value(known) for formula in options.values()], axis=1)
        mates = _mates(list(options))
        enough = _ENOUGH * np.sqrt(motion[0].size / 3)
        weight = _weights(left)
        looked = left * weight
        if part == "skin":
            looked *= _closely(rig.frame.rest, eyes)
        picked = yield from portion(_picked(columns * weight, looked, mates, most, enough), start, stop)
        shapes = _fitted(columns[:, picked] * weight, left * weight)
        peaks = np.abs(shapes).max(axis=1) * np.abs(columns[:, picked]).max(axis=0)
        labels = list(options)
        parts[part] = PartKeys(
            {
                n: end.reshape(-1, 3)
                for n, end in zip(names, ends, strict=True)
                if part == "skin" or abs(end).max() > 1e-3
            },
            {
                labels[k]: (options[labels[k]], shapes[i].reshape(-1, 3))
                for i, k in enumerate(picked)
                if peaks[i] > _SEEN
            },
        )
        for formula, _ in parts[part].driven.values():
            used |= set(formula.names())
    return Keys({name: lowest.get(name, 0.0) for name in names}, _needed(formulas, used), parts)


def _weights(left) -> np.ndarray:
    """(f, 1) of each pose, 1 on (quadratic) average, from what its sliders leave to the driven keys (f, 3 n) mm."""
    weight = (np.sqrt(3 * (left**2).mean(axis=1, keepdims=True)) + _SMALL) ** -_LESS
    return weight / np.sqrt((weight**2).mean())


def _closely(rest, eyes) -> np.ndarray:
    """(3 n,) how closely each coordinate of the skin is looked at."""
    lids = np.zeros(len(rest), bool)
    for eye in eyes:
        lids |= np.linalg.norm(rest - eye.centre, axis=1) < _LIDS * eye.radius
    return np.where(lids, _CLOSELY, 1.0).repeat(3)


def _mates(labels: list[str]) -> list[int]:
    """For each label the number of its mirror image; its own where it is that, or there is none."""
    at = {label: k for k, label in enumerate(labels)}
    found = []
    for k, label in enumerate(labels):
        image = re.sub(r"(?<=[ _])([lr])(?![a-z])", lambda side: "r" if side[1] == "l" else "l", label)
        first, star, second = image.removeprefix(MARK).partition("*")
        found.append(at.get(image, at.get(f"{MARK}{second}{star}{first}", k)))
    return found


def _picked(columns, left, mates, most, enough) -> Work:
    """Columns that explain ``left`` (f, c) best, one after the other and each with its mirror image, until the root mean
    square row is ``enough``."""
    rest = _principal(left)
    free = columns.copy()
    size = np.maximum((columns**2).sum(axis=0), 1e-12)
    picked: list[int] = []
    while len(picked) < most and np.sqrt((rest**2).sum() / len(rest)) > enough:
        yield Progress(len(picked) / most, f"Choosing shape keys: {len(picked)}")
        own = (free**2).sum(axis=0)
        gain = ((free.T @ rest) ** 2).sum(axis=1) / np.maximum(own, 1e-12)
        gain[own < 1e-3 * size] = 0.0  # the others say it already
        best = int(gain.argmax())
        if gain[best] <= 0:
            break
        for one in dict.fromkeys((best, mates[best])):
            left_over = (free[:, one] ** 2).sum()
            if one in picked or left_over < 1e-3 * size[one]:
                continue
            picked.append(one)
            unit = free[:, one] / np.sqrt(left_over)
            rest -= np.outer(unit, unit @ rest)
            free -= np.outer(unit, unit @ free)
    return picked


def _principal(left) -> np.ndarray:
    """(f, k) the rows of ``left`` in their first principal directions: what matters of them for a choice."""
    if left.shape[1] <= _DIRECTIONS:
        return left.copy()
    values, axes = np.linalg.eigh(left @ left.T)
    return axes[:, -_DIRECTIONS:] * np.sqrt(values[-_DIRECTIONS:].clip(0))


def _fitted(columns, left) -> np.ndarray:
    """(k, c) the shapes that with ``columns`` (f, k) come nearest to ``left`` (f, c)."""
    scale = np.maximum(np.sqrt((columns**2).sum(axis=0)), 1e-9)
    unit = columns / scale
    gram = unit.T @ unit + _RIDGE * np.eye(unit.shape[1])
    return np.linalg.solve(gram, unit.T @ left) / scale[:, None]


def _needed(formulas: dict[str, Formula], used: set[str]) -> dict[str, Formula]:
    """Those of ``formulas`` that ``used`` and what it is made of need, in their order."""
    for name in reversed(formulas):
        if name in used:
            used |= set(formulas[name].names())
    return {name: formula for name, formula in formulas.items() if name in used}
