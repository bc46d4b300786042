# SPDX-License-Identifier: GPL-3.0-or-later
"""The response rig as shape keys with drivers, which plays in any Blender without the extension and without scripts.

The sliders are the values of ordinary shape keys of the skin, one for each muscle and control. What bends their sum to
the simulation are driven keys, whose names begin with ``~``, so that they stand together below the sliders. What they
have in common (the jaw's opening, a muscle's force) is worked out once, in custom properties of the skin's shape keys.
"""

import json

import bpy
import numpy as np

from ..sim.acting.pose import CONTROLS
from ..sim.progress import Progress, Work, portion
from ..sim.response.actor import actor_of
from ..sim.response.keys import Keys, chosen_keys
from ..sim.response.mixtures import SIGNED
from ..sim.response.playing import played_parts, played_poses
from ..sim.response.quantities import letters, sliders
from . import bridge, heads, own_data, response, shape_keys

QUANTITIES = "headshop_rig"  # on the skin's object: names of the custom properties that belong to the rig
RANGE = 10.0  # what Blender allows the value of a shape key


def bake_rig(skin: bpy.types.Object) -> Work:
    """Choose the rig's shape keys and write them; returns a report.

    A response that is not up to date is prepared first, and kept with the head. The report holds ``sliders``, ``driven`` and
    ``quantities`` (counts), ``keys`` (part -> count) and ``accuracy_mm`` of the response behind them.

    Raises
    ------
    InputError : not a whole head, linked from another file, or the artist has a key of his own by a slider's name.
    """
    shape_keys.require_editable(skin)
    head = heads.read_head(skin)
    shape_keys.refuse_foreign(skin, (*(muscle.name for muscle in head.muscles), *CONTROLS))
    rig, accuracy = yield from response.stored_or_prepared(skin, 0.8)
    actor = actor_of(rig, head)
    poses = played_poses(actor, np.random.default_rng(0))
    played = yield from portion(played_parts(actor, poses), 0.8, 0.85)
    lowest = {name: -1.0 if name in SIGNED else 0.0 for name in sliders(rig)}
    keys: Keys = yield from portion(chosen_keys(rig, poses, played, lowest, head.eyes), 0.85, 0.99)
    yield Progress(1.0, "Writing shape keys")
    write_rig(skin, keys)
    return {
        "sliders": len(keys.sliders),
        "driven": len(keys.parts["skin"].driven),
        "quantities": len(keys.quantities),
        "keys": {part: len(each.plain) + len(each.driven) for part, each in keys.parts.items()},
        "accuracy_mm": accuracy,
    }


def write_rig(skin: bpy.types.Object, keys: Keys) -> None:
    """Store `Keys` as shape keys with drivers, in place of an earlier rig and of our keys by the sliders' names."""
    own_data.own_meshes(skin)
    remove_rig(skin)
    parts = heads.parts_of(skin)
    for part, each in keys.parts.items():
        obj = parts[part]
        ours = shape_keys.baked_report(obj)
        shape_keys.remove_keys(obj, [name for name in each.plain if name in ours])
        basis = bridge.read_positions(obj)
        turn = np.linalg.inv(heads.placement(skin, obj)[:3, :3]).T  # a part may have been moved on the skin
        for name, shape in each.plain.items():
            block = _key(obj, name, basis + shape @ turn)
            block.slider_min = keys.sliders[name]
        for name, (_, shape) in each.driven.items():
            block = _key(obj, name, basis + shape @ turn)
            block.slider_min, block.slider_max, block.lock_shape = -RANGE, RANGE, True
        peaks = {name: {"peak_mm": _peak(shape)} for name, shape in each.plain.items()}
        peaks |= {name: {"peak_mm": _peak(shape), "driven": True} for name, (_, shape) in each.driven.items()}
        own_data.keep_note(obj, shape_keys.SHAPES, json.dumps(shape_keys.baked_report(obj) | peaks))
    sources = skin.data.shape_keys
    for name, formula in keys.quantities.items():
        sources[name] = 0.0
        _drive(sources.driver_add(f'["{name}"]').driver, sources, formula, keys)
    own_data.keep_note(skin, QUANTITIES, json.dumps(list(keys.quantities)))
    for part, each in keys.parts.items():
        blocks = parts[part].data.shape_keys.key_blocks
        for name in each.plain if part != "skin" else ():
            shape_keys.follow(blocks[name], sources, name)
        for name, (formula, _) in each.driven.items():
            blocks[name].driver_remove("value")
            _drive(blocks[name].driver_add("value").driver, sources, formula, keys)
    settings = getattr(skin, "headshop", None)
    if settings is not None:
        settings.live = False  # else the extension's sliders would move the face a second time


def _key(obj, name: str, positions: np.ndarray) -> bpy.types.ShapeKey:
    block = bridge.ensure_shape_key(obj, name)
    bridge.write_positions(obj, positions, name)
    return block


def _peak(shape: np.ndarray) -> float:
    return round(float(np.linalg.norm(shape, axis=1).max(initial=0.0)), 4)


def _drive(driver: bpy.types.Driver, sources: bpy.types.Key, formula, keys: Keys) -> None:
    """Make a driver work out ``formula`` from sliders and quantities of the skin's shape keys ``sources``."""
    driver.type = "SCRIPTED"
    known = letters(formula)
    for name, letter in known.items():
        variable = driver.variables.new()
        variable.type, variable.name = "SINGLE_PROP", letter
        target = variable.targets[0]
        target.id_type, target.id = "KEY", sources
        escaped = bpy.utils.escape_identifier(name)
        target.data_path = f'key_blocks["{escaped}"].value' if name in keys.sliders else f'["{escaped}"]'
    driver.expression = formula.text(known)


def is_rigged(skin: bpy.types.Object) -> bool:
    """Whether a rig was baked onto the head."""
    return own_data.note(skin, QUANTITIES) is not None


def remove_rig(skin: bpy.types.Object) -> None:
    """Take a baked rig's driven keys and quantities off a head; its sliders are ordinary baked keys and stay."""
    if not is_rigged(skin):
        return
    for obj in heads.parts_of(skin).values():
        shape_keys.remove_keys(obj, shape_keys.driven_names(obj))
    keys = skin.data.shape_keys
    for name in json.loads(own_data.note(skin, QUANTITIES)):
        if keys is not None and name in keys:
            keys.driver_remove(f'["{name}"]')
            del keys[name]
    own_data.drop_note(skin, QUANTITIES)
