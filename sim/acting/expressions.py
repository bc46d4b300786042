# SPDX-License-Identifier: GPL-3.0-or-later
"""Expressions as muscle contractions, from the table ``assets/tables/expressions.json``."""

from pathlib import Path

from ..anatomy.head import Head
from ..json_keys import read_table
from .pose import CONTROLS, Pose, pose_from

TABLE = Path(__file__).resolve().parents[2] / "assets" / "tables" / "expressions.json"

#: The six basic expressions of Ekman.
BASIC = ("joy", "sadness", "anger", "fear", "disgust", "surprise")


def _both_sides(values: dict[str, float], paired: set[str]) -> dict[str, float]:
    """Paired muscles named without a side mean both sides; ``blink`` means both eyes."""
    out: dict[str, float] = {}
    for name, value in values.items():
        if name == "blink":
            out["blink_l"] = out["blink_r"] = value
        elif name in paired:
            out[name + "_l"] = out[name + "_r"] = value
        else:
            out[name] = value
    return out


def expressions(path=TABLE) -> dict[str, Pose]:
    """Name -> Pose of every expression of the table (neutral excluded), in its order.

    Raises
    ------
    InputError : ``path`` cannot be read, or is no such table.
    """
    table = read_table(path, "expressions", "unpaired_muscles")
    unpaired = set(table["unpaired_muscles"]) | set(CONTROLS)
    out = {}
    for name, row in table["expressions"].items():
        values = row["channels"]
        paired = {k for k in values if k not in unpaired and not k.endswith(("_l", "_r"))}
        out[name] = pose_from(_both_sides(values, paired))
    return out


def for_head(pose: Pose, muscle_names) -> Pose:
    """``pose`` without the muscles that a head does not have."""
    return Pose(
        {k: v for k, v in pose.muscles.items() if k in set(muscle_names)}, **{n: getattr(pose, n) for n in CONTROLS}
    )


def muscle_poses(head: Head) -> dict[str, Pose]:
    """One pose per muscle of ``head``, named after it: that muscle alone, fully contracted."""
    return {muscle.name: Pose({muscle.name: 1.0}) for muscle in head.muscles}
