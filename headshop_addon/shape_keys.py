# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulated poses as ordinary relative shape keys that play without the extension.

The skin gets one key a pose; the jaw's parts, teeth, tongue and eyes get a key of the same name wherever they move,
whose value follows the skin's through a driver without Python. Keys an artist made are never touched; which ones are
ours is written on each object in ``headshop_shapes``.
"""

import json

import bpy
import numpy as np

from ..sim.acting.models import DEFAULT, model_named
from ..sim.acting.pose import Pose, combined, control
from ..sim.errors import InputError
from ..sim.mesh_subdivision import drawn
from ..sim.progress import Progress, Work
from ..sim.tissue.posing import posed_parts
from . import bridge, heads, own_data

SHAPES = "headshop_shapes"
SCANNED = "Scan"  # the face with the expression that it was scanned with, if that was taken away
ITERATIONS = 200  # until it rests, not until it looks right
#: What a model may say of a solve besides, as it is kept in the report of a shape.
MORE = ("residual", "energy", "volume_drift_of", "penetration_of", "inverted_prisms")
STILL = 0.001  # mm: a part that moves less gets no key


def bake_poses(skin: bpy.types.Object, poses: dict[str, Pose], model: str = DEFAULT, over=None) -> Work:
    """Simulate each pose until it rests and store it as a shape key; returns name -> report.

    A report holds ``model``, ``peak_mm`` (of the surface drawn), ``volume_drift``, ``penetration_mm`` and ``converged``, and
    what else the model says of its solve (`sim.tissue.diagnostics`).
    Nothing is written before all poses are simulated: closing the generator leaves the head as it was.

    model : name of the model that acts (`sim.acting.models`)
    over : name -> name of the pose on top of which that shape is meant to play: its key holds the difference to it

    Raises
    ------
    InputError : no such model, not a whole head, linked from another file, or the artist has a key of his own by one of
        the names.
    """
    acting = model_named(model)
    require_editable(skin)
    refuse_foreign(skin, poses)
    yield Progress(0.0, "Building the tissue")
    head = heads.read_head(skin)
    built = acting.build(head)
    neutral = posed_parts(built, acting.rest_state(built), control(built, Pose()))
    shapes, report = {}, {}
    for number, (name, pose) in enumerate(poses.items()):
        yield Progress(0.1 + 0.9 * number / len(poses), f"Simulating {name}")
        start = neutral
        if over and name in over:
            start = posed_by(acting, built, poses[over[name]])[1]
            pose = combined(pose, poses[over[name]])
        solution, posed = posed_by(acting, built, pose)
        shapes[name] = {part: posed[part] - start[part] for part in posed}
        report[name] = {"model": model} | _report(solution, drawn(head.skin.faces, shapes[name]["skin"]))
    yield Progress(1.0, "Writing shape keys")
    write_shapes(skin, shapes, report)
    return report


def posed_by(acting, built, pose: Pose):
    """The solution of a pose, and all parts in it. From rest: a key must not depend on its neighbours."""
    asked = control(built, pose)
    solution = acting.solve(built, asked, max_iterations=ITERATIONS)
    return solution, posed_parts(built, solution.state, asked)


def _report(solution, delta: np.ndarray) -> dict:
    found = solution.diagnostics
    return {
        "peak_mm": round(float(np.linalg.norm(delta, axis=1).max()), 4),
        "volume_drift": round(float(found["volume_drift"]), 6),
        "penetration_mm": round(float(found["penetration_mm"]), 4),
        "converged": bool(solution.converged),
        **{name: _rounded(found[name]) for name in MORE if name in found},
    }


def _rounded(value):
    if isinstance(value, dict):
        return {name: _rounded(each) for name, each in value.items()}
    return round(value, 6)


def keep_as_scanned(skin: bpy.types.Object, vertices: np.ndarray) -> None:
    """Keep the skin's vertices (n, 3) mm as scanned in a shape key of value 0, which no bake touches."""
    bridge.ensure_shape_key(skin, SCANNED)
    bridge.write_positions(skin, vertices, SCANNED)


def as_scanned(skin: bpy.types.Object) -> np.ndarray | None:
    """The skin's vertices (n, 3) mm as scanned; None for a head that was not relaxed."""
    keys = skin.data.shape_keys
    return bridge.read_positions(skin, SCANNED) if keys and SCANNED in keys.key_blocks else None


def require_editable(skin: bpy.types.Object) -> None:
    """Raise `InputError` if the head is linked: its meshes cannot take shape keys, those of an override can (`own_meshes`)."""
    linked = [obj.name for obj in heads.parts_of(skin).values() if obj.library is not None]
    if linked:
        name = heads.head_name(skin)
        raise InputError(f"{name!r} is linked from another file: press Override Head first, or bake in that file.")


def baked_names(obj: bpy.types.Object) -> list[str]:
    """The shape keys of an object that a bake made and that are poses, in the order of the object's keys."""
    return [name for name, report in _there(obj).items() if not report.get("driven")]


def driven_names(obj: bpy.types.Object) -> list[str]:
    """The shape keys of a baked rig that only drivers move (`rig_keys`)."""
    return [name for name, report in _there(obj).items() if report.get("driven")]


def _there(obj: bpy.types.Object) -> dict[str, dict]:
    """Name -> report of our shape keys, in the order of the object's keys."""
    keys, ours = obj.data.shape_keys, baked_report(obj)
    return {block.name: ours[block.name] for block in keys.key_blocks if block.name in ours} if keys else {}


def baked_report(obj: bpy.types.Object) -> dict[str, dict]:
    """Name of each baked shape -> its report."""
    try:
        return json.loads(own_data.note(obj, SHAPES, "{}"))
    except (ValueError, TypeError):
        return {}


def refuse_foreign(skin: bpy.types.Object, names) -> None:
    """Raise `InputError` if an artist has a shape key of his own by one of the ``names``."""
    for obj in heads.parts_of(skin).values():
        keys, ours = obj.data.shape_keys, baked_report(obj)
        foreign = [name for name in names if keys and name in keys.key_blocks and name not in ours]
        if foreign:
            raise InputError(
                f"{obj.name!r} has a shape key {foreign[0]!r} of your own, which a bake would replace: rename it first."
            )


def write_shapes(skin: bpy.types.Object, shapes: dict[str, dict[str, np.ndarray]], report: dict[str, dict]) -> None:
    """Store name -> part -> displacements (n, 3) mm as shape keys with drivers, in place of ours of the same names."""
    own_data.own_meshes(skin)
    parts = heads.parts_of(skin)
    for part, obj in parts.items():
        moving = {
            name: deltas[part]
            for name, deltas in shapes.items()
            if part == "skin" or (part in deltas and np.abs(deltas[part]).max() > STILL)
        }
        ours = baked_report(obj)
        remove_keys(obj, [name for name in shapes if name in ours and name not in moving])
        basis = bridge.read_positions(obj)
        turn = np.linalg.inv(heads.placement(skin, obj)[:3, :3]).T  # a part may have been moved on the skin
        for name, delta in moving.items():
            block = bridge.ensure_shape_key(obj, name)
            bridge.write_positions(obj, basis + delta @ turn, name)
            if part != "skin":
                follow(block, skin.data.shape_keys, name)
        kept = {name: value for name, value in ours.items() if name not in shapes}
        if moving or ours:
            own_data.keep_note(obj, SHAPES, json.dumps(kept | {name: report.get(name, {}) for name in moving}))


def remove_keys(obj: bpy.types.Object, names) -> None:
    """Take shape keys away, with their drivers and what is noted about them."""
    keys = obj.data.shape_keys
    there = [name for name in names if keys is not None and name in keys.key_blocks]
    for name in there:
        block = keys.key_blocks[name]
        block.driver_remove("value")
        obj.shape_key_remove(block)
    ours = {name: value for name, value in baked_report(obj).items() if name not in names}
    if own_data.note(obj, SHAPES) is not None:
        own_data.keep_note(obj, SHAPES, json.dumps(ours))
    if there and len(keys.key_blocks) == 1:
        obj.shape_key_remove(keys.key_blocks[0])


def follow(block: bpy.types.ShapeKey, keys: bpy.types.Key, name: str) -> None:
    """Drive a key's value by the value of ``keys``' key ``name`` (a sum of one variable: no Python is run)."""
    block.driver_remove("value")
    driver = block.driver_add("value").driver
    driver.type = "SUM"
    variable = driver.variables.new()
    variable.type = "SINGLE_PROP"
    target = variable.targets[0]
    target.id_type, target.id = "KEY", keys
    target.data_path = f'key_blocks["{bpy.utils.escape_identifier(name)}"].value'
