# SPDX-License-Identifier: GPL-3.0-or-later
"""A performance over time: every frame simulated, then kept as a few principal shape keys with F-curves.

What is written plays without the extension: relative shape keys and one slotted action, nothing else.
"""

import json
from dataclasses import replace

import bpy
import numpy as np

from ..sim.acting.models import DEFAULT, model_named
from ..sim.acting.pose import CONTROLS, Pose, control
from ..sim.acting.principal import principal_shapes
from ..sim.errors import InputError
from ..sim.progress import Progress, Work
from ..sim.tissue.posing import posed_parts
from . import bridge, head_place, heads, own_data, shape_keys
from .slotted_actions import animate_keys, curves_of, keyed_by_us, moved_otherwise, new_action, stop, value_path

PERFORMANCE = "headshop_performance"
#: mm that the principal shape keys may differ from the simulation, which itself settles to 0.01 mm: asking for more
#: would spend shape keys on its noise.
TOLERANCE = 0.02
ITERATIONS = 60  # a frame begins where the one before ended, so little is left to do
MET = 0.1  # mm: the last step of the solver at which a frame in motion counts as converged
#: Frames, seven minutes of film: their motion, and the matrix of frames by frames that compresses it, take some 8 GB, as
#: reckoned from the sizes of these arrays.
MOST = 10_000
_PATHS = {"headshop.muscles.": "muscles", "headshop.controls.": "controls"}


def require_few(frames: int) -> None:
    """Raise `InputError` for more frames than can be baked at once."""
    if frames > MOST:
        raise InputError(
            f"{frames:,} frames are more than can be baked at once: bake {MOST:,} or fewer, at a lower frame rate or in "
            "parts."
        )


def is_keyed(skin: bpy.types.Object) -> bool:
    """Whether any muscle or control slider of the head is moved by F-curves, NLA strips or drivers."""
    return any(path.startswith(start) for path in {*curves_of(skin), *moved_otherwise(skin)} for start in _PATHS)


def keyed_poses(skin: bpy.types.Object, frames, scene: bpy.types.Scene | None = None) -> list[Pose]:
    """The poses that the sliders have at ``frames``; sliders that nothing moves keep the value they have.

    Where only the action's own F-curves move them these are read; else ``scene`` is played, for NLA strips blend and drivers
    depend on other objects.
    """
    rows = _played(skin, frames, scene or bpy.context.scene) if _is_played(skin) else _read(skin, frames)
    return [
        Pose(
            muscles={name: value for name, value in row["muscles"].items() if value},
            **{name: value for name, value in row["controls"].items() if name in CONTROLS},
        )
        for row in rows
    ]


def _is_played(skin) -> bool:
    return any(path.startswith(start) for path in moved_otherwise(skin) for start in _PATHS)


def _played(skin, frames, scene) -> list[dict[str, dict[str, float]]]:
    return [
        {group: getattr(shown.headshop, group).values() for group in _PATHS.values()}
        for shown in head_place.at_frames(skin, scene, frames)
    ]


def _read(skin, frames) -> list[dict[str, dict[str, float]]]:
    settings, curves = getattr(skin, "headshop", None), curves_of(skin)
    rows = []
    for frame in frames:
        row = {}
        for start, group in _PATHS.items():
            still = getattr(settings, group, None)
            row[group] = still.values() if still else {}
            for path, curve in curves.items():
                if path.startswith(start):
                    row[group][path[len(start) :]] = float(curve.evaluate(frame))
        rows.append(row)
    return rows


def bake_performance(
    skin: bpy.types.Object,
    poses: list[Pose],
    first_frame: int = 1,
    name: str = "Performance",
    model: str = DEFAULT,
    around=None,
    fps: float | None = None,
) -> Work:
    """Simulate ``poses``, one a frame from ``first_frame`` on, into animated shape keys; returns a report.

    Without ``fps`` every frame comes to rest, and starts from the one before; with it (frames a second), the tissue moves in
    time, and swings. The report holds ``model``, ``frames``, ``converged`` (frames), ``keys``
    (part -> count), ``error_mm`` (of the compression) and ``peak_mm``. Nothing is written before all is simulated. An earlier
    performance of the head is replaced; its other shape keys stay.

    model : name of the model that acts (`sim.acting.models`)
    around : function of the skin's points (n, 3) mm at rest that returns what acts from outside at every frame

    Raises
    ------
    InputError : more than `MOST` frames, no such model, one that cannot move in time, not a whole head, or linked from
        another file.
    """
    require_few(len(poses))
    acting = model_named(model)
    if fps is not None and not acting.moves:
        raise InputError(f"The model {model} comes to rest in every frame: only {DEFAULT} bakes with dynamics.")
    shape_keys.require_editable(skin)
    yield Progress(0.0, "Building the tissue")
    head = heads.read_head(skin)
    built = acting.build(head)
    state = acting.rest_state(built)
    neutral = posed_parts(built, state, control(built, Pose()))
    motion = {part: np.empty((len(poses), *points.shape), dtype=np.float32) for part, points in neutral.items()}
    controls = [control(built, pose) for pose in poses]
    if around is not None:
        outer = around(neutral["skin"])
        controls = [replace(asked, around=felt) for asked, felt in zip(controls, outer, strict=True)]
    converged = 0
    if fps is None:
        states = acting.resting(built, controls, ITERATIONS)
    else:
        states = _in_time(acting, built, controls, fps)
    for number, asked in enumerate(controls):
        yield Progress(0.05 + 0.9 * number / len(poses), f"Simulating frame {number + 1} of {len(poses)}")
        state, settled = next(states)
        converged += bool(settled)
        for part, points in posed_parts(built, state, asked).items():
            motion[part][number] = points - neutral[part]
    yield Progress(0.96, "Compressing")
    found = {p: principal_shapes(m, TOLERANCE) for p, m in motion.items() if np.abs(m).max(initial=0.0) > TOLERANCE}
    yield Progress(1.0, "Writing shape keys")
    write_performance(skin, found, np.arange(first_frame, first_frame + len(poses)), name)
    return {
        "model": model,
        "dynamics": fps is not None,
        "frames": len(poses),
        "converged": converged,
        "keys": {part: len(each.shapes) for part, each in found.items()},
        "error_mm": max((each.error for each in found.values()), default=0.0),
        "peak_mm": float(np.linalg.norm(motion["skin"], axis=2).max(initial=0.0)),
    }


def _in_time(acting, built, controls, fps):
    """Yields the state in motion at each of ``controls``, and whether its equations are met."""
    for asked, (state, residual) in zip(controls, acting.moving(built, controls, 1 / fps), strict=True):
        yield acting.cleared(built, asked, state), residual <= MET


def write_performance(skin, found: dict, frames: np.ndarray, name: str) -> None:
    """Store part -> `Principal` as shape keys of each part and one action with a slot for each."""
    own_data.own_meshes(skin)
    remove_performance(skin)
    action = new_action(f"{heads.head_name(skin)} {name}")
    for part, obj in heads.parts_of(skin).items():
        if part not in found:
            continue
        basis, turn = bridge.read_positions(obj), np.linalg.inv(heads.placement(skin, obj)[:3, :3]).T
        weights = {}
        for number, shape in enumerate(found[part].shapes):
            block = bridge.ensure_shape_key(obj, _free_name(obj, f"{name}_{number + 1:02d}"))
            block.slider_min, block.slider_max = -1.0, 1.0
            bridge.write_positions(obj, basis + shape @ turn, block.name)
            weights[block.name] = found[part].weights[:, number]
        own_data.keep_note(obj, PERFORMANCE, json.dumps(list(weights)))
        animate_keys(action, obj.data.shape_keys, frames, weights)
    if not len(action.slots):
        bpy.data.actions.remove(action)  # nothing moves
    settings = getattr(skin, "headshop", None)
    if settings is not None:
        settings.live = False  # else the sliders would move the face a second time


def baked_weights(skin: bpy.types.Object) -> tuple[list[str], np.ndarray, np.ndarray] | None:
    """The skin's shape keys of a baked performance, its frames (f,) and their weights (f, k); None if there is none."""
    names = json.loads(own_data.note(skin, PERFORMANCE, "[]"))
    curves = {} if skin.data.shape_keys is None else keyed_by_us(skin.data.shape_keys)
    keyed = {name: curves.get(value_path(name)) for name in names}
    names = [name for name, curve in keyed.items() if curve is not None]
    if not names:
        return None
    return names, keyed[names[0]][0], np.stack([keyed[name][1] for name in names], axis=1)


def _free_name(obj, name: str) -> str:
    keys = obj.data.shape_keys
    while keys is not None and name in keys.key_blocks:
        name += "'"
    return name


def remove_performance(skin: bpy.types.Object) -> None:
    """Take a baked performance off a head."""
    head_place.remove_motion(skin)
    for obj in heads.parts_of(skin).values():
        names = json.loads(own_data.note(obj, PERFORMANCE, "[]"))
        if obj.data.shape_keys is not None:
            stop(obj.data.shape_keys)
        shape_keys.remove_keys(obj, names)
        if own_data.note(obj, PERFORMANCE) is not None:
            own_data.drop_note(obj, PERFORMANCE)
