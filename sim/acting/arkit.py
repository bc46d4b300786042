# SPDX-License-Identifier: GPL-3.0-or-later
"""The ARKit blendshapes as poses, from the table ``assets/tables/arkit.json``."""

from pathlib import Path

from ..json_keys import read_table
from .pose import Pose, pose_from

TABLE = Path(__file__).resolve().parents[2] / "assets" / "tables" / "arkit.json"
#: Controls whose sign turns over in the mirror.
_SIDEWAYS = ("jaw_side", "gaze_x", "gaze_l_x", "gaze_r_x")


def poses(path=TABLE) -> dict[str, Pose]:
    """ARKit's name, exactly as Apple spells it -> Pose.

    Raises
    ------
    InputError : ``path`` cannot be read, or is no such table.
    """
    out = {}
    for name, channels in read_table(path, "shapes")["shapes"].items():
        out[name] = pose_from(channels)
        if name.endswith("Left"):
            out[name.removesuffix("Left") + "Right"] = pose_from(mirrored(channels))
    return out


def over(path=TABLE) -> dict[str, str]:
    """Name of a shape that plays on top of another -> name of that other. Raises `InputError` as `poses`."""
    return read_table(path, "over")["over"]


def mirrored(channels: dict[str, float]) -> dict[str, float]:
    """Channels of the mirror image."""
    other = {"l": "r", "r": "l"}
    out = {}
    for name, value in channels.items():
        parts = [other.get(part, part) for part in name.split("_")]
        out["_".join(parts)] = -value if name in _SIDEWAYS else value
    return out
