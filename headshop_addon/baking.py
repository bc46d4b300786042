# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes by name: a set of poses, a performance file, or the keyed sliders, with the head's report kept up to date."""

from functools import partial

import bpy
import numpy as np

from ..sim.acting import arkit, expressions, outer
from ..sim.acting.models import DEFAULT
from ..sim.errors import InputError
from ..sim.progress import Work, portion
from . import head_place, heads, own_data, performance, rig_keys, shape_keys
from .provenance import timed, versions

SETS = ("expressions", "muscles", "arkit")
RIG = "rig"  # a set of sliders that play the simulation together, instead of poses


def poses_of_set(skin: bpy.types.Object, name: str) -> tuple[dict, dict]:
    """Name -> Pose of a set of `SETS`, and name -> name of the pose on top of which a shape plays, for those that do.

    Raises
    ------
    InputError : there is no such set.
    """
    if name in SETS:
        head = heads.read_head(skin)
        if name == "muscles":
            return expressions.muscle_poses(head), {}
        names = [muscle.name for muscle in head.muscles]
        poses, over = (arkit.poses(), arkit.over()) if name == "arkit" else (expressions.expressions(), {})
        return {key: expressions.for_head(pose, names) for key, pose in poses.items()}, over
    raise InputError(f"The set {name} is not in this version: bake --set {', '.join((*SETS, RIG))}.")


def bake(
    skin: bpy.types.Object, pose_set: str | None = None, acted=None, model: str = DEFAULT, dynamics: bool = False
) -> Work:
    """Bake a set of poses or the rig, a performance (`sim.acting.performance`), or both, by a model (`sim.acting.models`).

    dynamics : whether the tissue swings in the performance, or rests in every frame

    Returns what this bake made, in the form of the head's report, which holds that of earlier bakes as well: ``rig``,
    ``shapes`` and ``performance``, those that there are. A performance sets the scene's frame rate and range to its own.

    Raises
    ------
    InputError : the performance has more frames than can be baked at once.
    """
    if acted is not None:
        performance.require_few(acted.frame_count)
    report = heads.read_report(skin)
    seconds = dict(report.get("seconds", {}))
    border = 1.0 if acted is None else 0.5
    made = {}
    if pose_set == RIG:
        from .response import require_own_model

        require_own_model(model)
        with timed(seconds, "bake_rig"):
            made["rig"] = yield from portion(rig_keys.bake_rig(skin), 0.0, border)
    elif pose_set is not None:
        with timed(seconds, f"bake_{pose_set}"):
            poses, over = poses_of_set(skin, pose_set)
            made["shapes"] = yield from portion(shape_keys.bake_poses(skin, poses, model, over), 0.0, border)
    if acted is not None:
        with timed(seconds, "bake_performance"):
            work = bake_acted(skin, acted, None, model, dynamics)
            made["performance"] = yield from portion(work, 0.0 if pose_set is None else border, 1.0)
    report |= made
    if "shapes" in made:
        report["shapes"] = {name: row for name, row in shape_keys.baked_report(skin).items() if "converged" in row}
    report["seconds"] = seconds
    report["versions"] = versions()
    heads.write_report(skin, report)
    return made


def bake_acted(
    skin: bpy.types.Object,
    acted,
    scene: bpy.types.Scene | None = None,
    model: str = DEFAULT,
    dynamics: bool = False,
) -> Work:
    """Bake a performance from frame 1 on, at its own frame rate, which becomes the scene's; the head moves as it says."""
    scene = scene or bpy.context.scene
    poses = acted.frames()
    around = None
    if any(name in outer.OUTER for name in acted.channels):
        around = partial(outer.surroundings, acted, moving=dynamics)
    report = yield from performance.bake_performance(
        skin, poses, model=model, around=around, fps=acted.fps if dynamics else None
    )
    motion = outer.head_motion(acted)
    head_place.write_motion(skin, motion, 1 + np.arange(len(poses)), f"{heads.head_name(skin)} Head Motion")
    head_place.set_frame_rate(scene, acted.fps)
    scene.frame_start, scene.frame_end = 1, max(len(poses), 1)
    return report


def is_baked(skin: bpy.types.Object) -> bool:
    """Whether shapes, a rig or a performance were baked onto the head."""
    return bool(shape_keys.baked_names(skin)) or any(
        own_data.note(obj, performance.PERFORMANCE) is not None for obj in heads.parts_of(skin).values()
    )


def remove_baked(skin: bpy.types.Object) -> None:
    """Take baked shapes, rig and performance off a head; the artist's own shape keys stay, and the sliders move the face.

    Raises
    ------
    InputError : linked from another file.
    """
    shape_keys.require_editable(skin)
    own_data.own_meshes(skin)
    moved = rig_keys.is_rigged(skin) or own_data.note(skin, performance.PERFORMANCE) is not None
    rig_keys.remove_rig(skin)
    performance.remove_performance(skin)
    for obj in heads.parts_of(skin).values():
        shape_keys.remove_keys(obj, shape_keys.baked_names(obj))
    settings = getattr(skin, "headshop", None)
    if settings is not None and moved:  # `Live` was switched off for what moved the face instead
        settings.live = True


def summary(made: dict) -> str:
    """A sentence of what `bake` made."""
    said = []
    if made.get("rig"):
        rig = made["rig"]
        said.append(f"a rig of {rig['sliders']} sliders and {rig['driven']} driven shape keys")
    if made.get("shapes"):
        worst = max(shape["penetration_mm"] for shape in made["shapes"].values())
        settled = sum(shape["converged"] for shape in made["shapes"].values())
        said.append(f"{len(made['shapes'])} shapes ({settled} at rest, deepest penetration {worst:.2f} mm)")
    if made.get("performance"):
        acting = made["performance"]
        frames, keys = acting["frames"], acting["keys"].get("skin", 0)
        said.append(f"{frames} frame{'s' * (frames != 1)} in {keys} shape key{'s' * (keys != 1)} of the skin")
    return ", ".join(said)
