# SPDX-License-Identifier: GPL-3.0-or-later
"""Animation in one slotted action (Blender 4.4 and later): a slot for each animated datablock."""

import bpy
import numpy as np

_LINEAR = 1  # Keyframe.interpolation, as foreach_set wants it
OURS = "headshop"


def new_action(name: str) -> bpy.types.Action:
    """An empty layered action, marked as ours."""
    action = bpy.data.actions.new(name)
    action[OURS] = True
    action.layers.new("Layer").strips.new(type="KEYFRAME")
    return action


def animate_keys(action: bpy.types.Action, keys: bpy.types.Key, frames, weights: dict[str, np.ndarray]) -> None:
    """Give ``keys`` a slot of ``action``: shape key name -> values (f,) stand at ``frames`` (f,), linear between."""
    paths = {(value_path(name), 0): v for name, v in weights.items()}
    animate(action, keys, "KEY", frames, paths)


def value_path(name: str) -> str:
    """Data path of a shape key's value."""
    return f'key_blocks["{bpy.utils.escape_identifier(name)}"].value'


def animate(action: bpy.types.Action, owner: bpy.types.ID, kind: str, frames, curves: dict) -> None:
    """Give ``owner``, an ID of ``kind``, a slot of ``action``: (data path, index) -> values (f,) stand at ``frames`` (f,),
    linear between.

    Where an artist animates the same datablock, his action stays and ours plays beside it as an NLA strip.
    """
    slot = action.slots.new(id_type=kind, name=owner.name)
    bag = action.layers[0].strips[0].channelbag(slot, ensure=True)
    for (path, index), values in curves.items():
        curve = bag.fcurves.new(path, index=index)
        curve.keyframe_points.add(len(frames))
        points = np.stack([frames, values], axis=1).astype(np.float32)
        curve.keyframe_points.foreach_set("co", points.ravel())
        curve.keyframe_points.foreach_set("interpolation", np.full(len(frames), _LINEAR, dtype=np.int32))
        curve.update()
    data = owner.animation_data or owner.animation_data_create()
    if data.action is None:
        data.action, data.action_slot = action, slot
    else:
        strip = data.nla_tracks.new().strips.new(action.name, int(frames[0]), action)
        strip.action_slot = slot


def stop(owner: bpy.types.ID) -> None:
    """Take our actions off a datablock; an action nobody uses any more is deleted."""
    data = owner.animation_data
    if data is None:
        return
    actions = {data.action} if data.action is not None and data.action.get(OURS) else set()
    if actions:
        data.action = None
    for track in list(data.nla_tracks):
        mine = {strip.action for strip in track.strips if strip.action is not None and strip.action.get(OURS)}
        if mine:
            actions |= mine
            data.nla_tracks.remove(track)
    for action in actions:
        if action.users == 0:
            bpy.data.actions.remove(action)


def curves_of(owner: bpy.types.ID) -> dict[str, bpy.types.FCurve]:
    """Data path -> F-curve of an ID's action, in its slot; muted curves are left out."""
    data = owner.animation_data
    if data is None or data.action is None or data.action_slot is None:
        return {}
    bags = [strip.channelbag(data.action_slot) for layer in data.action.layers for strip in layer.strips]
    return {curve.data_path: curve for bag in bags if bag is not None for curve in bag.fcurves if not curve.mute}


def moved_otherwise(owner: bpy.types.ID) -> set[str]:
    """Data paths that NLA strips or drivers move, tracks and drivers that are muted left out."""
    data = owner.animation_data
    if data is None:
        return set()
    found = {curve.data_path for curve in data.drivers if not curve.mute}
    for track in data.nla_tracks if data.use_nla else ():
        for strip in () if track.mute else track.strips:
            if strip.action is not None and strip.action_slot is not None and not strip.mute:
                bags = [s.channelbag(strip.action_slot) for layer in strip.action.layers for s in layer.strips]
                found |= {curve.data_path for bag in bags if bag is not None for curve in bag.fcurves if not curve.mute}
    return found


def keyed_by_us(owner: bpy.types.ID) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Data path -> frames (f,) and values (f,) of the keys that `animate` gave a datablock."""
    data = owner.animation_data
    if data is None:
        return {}
    played = [(data.action, data.action_slot)]
    played += [(strip.action, strip.action_slot) for track in data.nla_tracks for strip in track.strips]
    found = {}
    for action, slot in played:
        if action is not None and slot is not None and action.get(OURS):
            for curve in action.layers[0].strips[0].channelbag(slot).fcurves:
                points = np.empty(2 * len(curve.keyframe_points), dtype=np.float32)
                curve.keyframe_points.foreach_get("co", points)
                found[curve.data_path] = points[0::2].astype(float), points[1::2].astype(float)
    return found
