# SPDX-License-Identifier: GPL-3.0-or-later
"""Mixtures to learn from: muscles few, many and all at random, and expressions as artists compose them.

Left eye, right eye and mouth hardly meet, so a mixture draws each of them anew: one solve teaches about all three. What
artists key are shapes on top of each other at any strength, mostly the same on both sides: composed of rows of our own
tables of shapes and expressions, none of them as it stands there.
"""

from functools import cache

import numpy as np

from ..acting import arkit, expressions
from ..acting.pose import CONTROLS, Pose, pose_from
from ..tissue.muscle_field import JAW_MUSCLES, LIPS, base_name

#: Channels that go below 0.
SIGNED = ("jaw_forward", "jaw_side", "gaze_x", "gaze_z", "gaze_l_x", "gaze_l_z", "gaze_r_x", "gaze_r_z")
SIGNED += ("lip_upper_forward", "lip_lower_forward", "cheek_puff")

_EYES = ("frontalis", "corrugator", "lateral_corrugator", "depressor_supercilii", "procerus", "orbicularis_oculi")
_EYES += ("levator_palpebrae", "auricularis", "occipitalis")
#: How often a mixture uses every muscle of a place at once, a control at all, the jaw open, and each sphincter of the
#: lips and its centre: what lips do against each other and the teeth is the hardest to learn.
_CROWD, _OFTEN, _OPEN, _LIPS = 0.15, 0.3, 0.55, 0.45
#: How often both sides do the same, as they do in most expressions: a mixture, a row of a composed one.
_ALIKE, _ROW_ALIKE = 0.35, 0.6
#: Channels drawn a little beyond their end and clipped, so that the end itself is seen often.
_BEYOND = 1.15
#: Of a composed pose: how likely each further row is, its strengths, and by how much its channels differ from the table's
#: (log of a factor) at most.
_FURTHER, _STRENGTH, _OTHERWISE = 0.55, (0.15, 1.2), 0.5
#: How often eyes look anywhere under lids anywhere, and both lids are then wholly shut or open: little motion, but an
#: eyeball shows through lids at once.
_LOOKS, _SHUT = 0.35, 0.3
#: How often a composed pose moves these besides.
_BESIDES = {"jaw_open": 0.4, "jaw_side": 0.15, "jaw_forward": 0.15, "lips_together": 0.15}


def channels(muscle_names) -> tuple[str, ...]:
    """Channels of a pose that move skin."""
    return (*muscle_names, *(name for name in CONTROLS if name != "tongue_out"))


def mixed_pose(muscle_names, rng: np.random.Generator) -> Pose:
    """Muscles at random: in each place a few or all of them, and some of the controls."""
    values: dict[str, float] = {}
    for place in _places(muscle_names):
        few = min(len(place), 1 + rng.geometric(0.25)) if rng.uniform() > _CROWD else len(place)
        for k in rng.choice(len(place), few, replace=False) if place else ():
            values[place[k]] = min(rng.uniform(0, _BEYOND), 1.0)
    for sphincter, centre in zip(LIPS, ("lip_upper_forward", "lip_lower_forward"), strict=True):
        if rng.uniform() < _LIPS and sphincter in muscle_names:
            values[sphincter] = min(rng.uniform(0.1, _BEYOND), 1.0)
        if rng.uniform() < _LIPS:
            values[centre] = rng.uniform(-_BEYOND, _BEYOND)
    if rng.uniform() < _OPEN:
        values["jaw_open"] = min(rng.uniform(0, 1.05), 1.0)
    for name in channels(muscle_names)[len(muscle_names) :]:
        if name.startswith(("jaw_open", "lip_")) or rng.uniform() > _OFTEN:
            continue
        values[name] = rng.uniform(-_BEYOND if name in SIGNED else 0.0, _BEYOND)
    if rng.uniform() < _LOOKS:
        values |= look(rng)
    if rng.uniform() < _ALIKE:
        values = {name: value for name, value in values.items() if not name.endswith("_r")}
        values |= {name[:-2] + "_r": value for name, value in values.items() if name.endswith("_l")}
    return within(values)


def crowded_pose(muscle_names, rng: np.random.Generator) -> Pose:
    """All muscles at random, and the jaw anywhere in its range in half of such poses."""
    values = {name: rng.uniform() for name in muscle_names if base_name(name) not in JAW_MUSCLES}
    if rng.uniform() < 0.5:
        values |= {"jaw_open": rng.uniform(), "jaw_forward": rng.uniform(-1, 1), "jaw_side": rng.uniform(-1, 1)}
    return within(values)


def composed_pose(muscle_names, rng: np.random.Generator) -> Pose:
    """Rows of the tables on top of each other, the eyes' and the mouth's parts apart, each at any strength."""
    values: dict[str, float] = {}
    for rows in _rows(tuple(muscle_names)):
        for _ in range(min(rng.geometric(1 - _FURTHER), 5) if rows else 0):
            row = rows[rng.integers(len(rows))]
            strength, otherwise = min(rng.uniform(*_STRENGTH), 1.0), rng.uniform(0, _OTHERWISE)
            row = {name: value * strength * np.exp(otherwise * rng.normal()) for name, value in row.items()}
            image = arkit.mirrored(row)
            if rng.uniform() < _ROW_ALIKE and not any(row[name] * image.get(name, 0) < 0 for name in row):
                row = image | row
            for name, value in row.items():
                values[name] = values.get(name, 0.0) + value
    for name, often in _BESIDES.items():
        if rng.uniform() < often:
            values[name] = values.get(name, 0.0) + rng.uniform(-1 if name in SIGNED else 0, 1)
    if rng.uniform() < _LOOKS:
        values |= look(rng)
    return within(values)


def look(rng: np.random.Generator) -> dict[str, float]:
    """Channels of eyes that look anywhere, each under lids anywhere."""
    lids = [rng.integers(2)] * 2 if rng.uniform() < _SHUT else rng.uniform(size=2)
    values = {"blink_l": float(lids[0]), "blink_r": float(lids[1])}
    return values | {"gaze_x": rng.uniform(-1, 1), "gaze_z": rng.uniform(-1, 1)}


def within(values: dict[str, float]) -> Pose:
    """The pose of these channels, each kept within its range."""
    return pose_from({name: np.clip(value, -1 if name in SIGNED else 0, 1) for name, value in values.items()})


@cache
def _rows(muscle_names) -> tuple[list[dict[str, float]], list[dict[str, float]]]:
    """What the rows of both tables ask of eyes and brows, and of the rest of the face."""
    eyes, mouth = [], []
    used = channels(muscle_names)
    for pose in (*arkit.poses().values(), *expressions.expressions().values()):
        row = {name: value for name, value in pose.values().items() if value and name in used}
        seen = {name: value for name, value in row.items() if name.startswith((*_EYES, "blink", "gaze"))}
        said = {name: value for name, value in row.items() if name not in seen}
        eyes += [seen] if seen else []
        mouth += [said] if said else []
    return eyes, mouth


def _places(muscle_names) -> list[list[str]]:
    out: list[list[str]] = [[], [], []]
    for name in muscle_names:
        if base_name(name) not in JAW_MUSCLES:
            out[(1 if name.endswith("_r") else 0) if name.startswith(_EYES) else 2].append(name)
    return out
