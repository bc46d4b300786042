# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's own soft body and cloth on the same skin, shaken by the same motion of the head, without a window.

The bodies hold to the skin where ours is fixed, and elsewhere by goals as firm as our restoration is. ``same springs``: a
soft body whose edges are our springs over all three layers, bone nodes fixed; it gets no contact, no volume, no muscles.
What each moves tells whether it simulates a face at all: ours is in the row before.
"""

import importlib.util
from dataclasses import replace

import numpy as np
from tissue_clip import FPS, Clock, clip, shake

from headshop.sim.tissue.dynamics import GAMMA, moving
from headshop.sim.tissue.solver import factorised, rest_state

#: Blender's default stiffness of cloth, and the pull of a soft body's edges (its most is 1).
TENSION, PULL = 15.0, 0.9


def available() -> bool:
    """Whether Blender's module is there."""
    return importlib.util.find_spec("bpy") is not None


def rows(model, factors, frames: int):
    """Yields a row for each kind of body and stiffness; ``model``: ours of the head."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.use_gravity = False  # the scan is at rest under it, as our model takes it
    n = model.count
    skin = model.layers.nodes[:n]
    held = np.where(model.layers.free[:n], np.clip(model.layers.restoration / model.layers.area, 0.05, 0.7), 1.0)
    sides = np.unique(np.sort(np.concatenate([model.faces[:, [k, (k + 1) % 4]] for k in range(4)]), axis=1), axis=0)
    sides = sides[(sides >= 0).all(axis=1)]
    springs = np.stack([model.springs.first, model.springs.second], axis=1)
    free = np.concatenate([model.layers.free, np.zeros(n, bool)])
    yield {"body": "headshop, all of it", "stiffness": 1, **_ours(model, frames)}
    for factor in factors:
        body = _object(skin, sides, model.faces, np.where(model.layers.free[:n], 0.0, 1.0))
        yield {"body": "cloth, skin alone", "stiffness": factor, **_measured(body, _cloth(factor), frames, n)}
        body = _object(skin, sides, model.faces, held)
        yield {"body": "soft body, skin alone", "stiffness": factor, **_measured(body, _soft(factor), frames, n)}
    for name, settings in (("same springs", {}), ("same springs, careful", {"error_threshold": 0.01, "step_min": 50})):
        body = _object(model.layers.nodes, springs, None, np.where(free, 0.0, 1.0))
        yield {"body": f"soft body, {name}", "stiffness": 1, **_measured(body, _soft(1.0, **settings), frames, n)}


def _ours(model, frames):
    """Our own step on the shaken head with a face at rest."""
    from headshop.sim.acting.pose import Pose, control

    still = control(model, Pose())
    controls = [replace(still, around=c.around) for c in clip(model, frames + 1, shaken=True)]
    factorised(model, GAMMA / FPS)
    with Clock() as clock:
        path = [state.skin for state, _ in moving(model, controls, 1 / FPS, rest_state(model))]
    peak = float(np.linalg.norm(np.array(path) - path[0], axis=2).max())
    return {"cpu_s": clock.cpu / frames, "elapsed_s": clock.elapsed / frames, "frames": frames, "peak_mm": peak}


def _object(points, sides, faces, goal):
    """An object of ``points`` (k, 3) mm whose group ``goal`` holds it, moved as the head is."""
    import bpy

    mesh = bpy.data.meshes.new("body")
    polygons = [] if faces is None else [[int(v) for v in face if v >= 0] for face in faces]
    mesh.from_pydata((points / 1000).tolist(), [] if faces is not None else sides.tolist(), polygons)
    body = bpy.data.objects.new("body", mesh)
    bpy.context.scene.collection.objects.link(body)
    group = body.vertex_groups.new(name="goal")
    for weight in np.unique(np.round(goal, 2)):
        group.add(np.flatnonzero(np.round(goal, 2) == weight).tolist(), float(weight), "REPLACE")
    return body


def _cloth(factor):
    def add(body):
        settings = body.modifiers.new("Cloth", "CLOTH").settings
        settings.quality = 5
        settings.vertex_group_mass = "goal"
        settings.tension_stiffness = settings.compression_stiffness = settings.shear_stiffness = TENSION * factor
        return body.modifiers["Cloth"].point_cache

    return add


def _soft(factor, **limits):
    def add(body):
        modifier = body.modifiers.new("Softbody", "SOFT_BODY")
        settings = modifier.settings
        settings.vertex_group_goal = "goal"
        settings.use_goal, settings.use_edges, settings.use_stiff_quads = True, True, True
        settings.goal_default = 1.0
        settings.goal_min, settings.goal_max = 0.0, 1.0
        # pull and push end at 1: what is stiffer than that is a lighter body
        settings.pull = settings.push = PULL
        settings.mass = 1.0 / factor
        for name, value in limits.items():
            setattr(settings, name, value)
        return modifier.point_cache

    return add


def _measured(body, add, frames, count):
    """Time of a frame, and the farthest that a point of the skin comes from where the head takes it, mm."""
    import bpy

    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = int(FPS), 1, frames + 1
    motion = shake(frames + 1)
    body.rotation_mode = "QUATERNION"
    for k, (turn, place) in enumerate(zip(motion.rotations, motion.positions, strict=True)):
        body.location = place / 1000
        body.rotation_quaternion = _quaternion(turn)
        body.keyframe_insert("location", frame=k + 1)
        body.keyframe_insert("rotation_quaternion", frame=k + 1)
    cache = add(body)
    cache.frame_start, cache.frame_end = 1, frames + 1
    scene.frame_set(1)
    rest = _positions(body)[:count]
    peak = 0.0
    with Clock() as clock:
        for frame in range(2, frames + 2):
            scene.frame_set(frame)
            off = np.linalg.norm(_positions(body)[:count] - rest, axis=1).max()
            peak = max(peak, float(off)) if np.isfinite(off) else np.inf
    broken = not np.isfinite(peak)
    bpy.data.objects.remove(body)
    cost = {"cpu_s": clock.cpu / frames, "elapsed_s": clock.elapsed / frames, "frames": frames}
    return cost | {"peak_mm": None if broken else peak, "broken": broken}


def _quaternion(turn):
    from mathutils import Matrix

    return Matrix(turn.tolist()).to_quaternion()


def _positions(body):
    """(k, 3) mm in the body's own space, modifiers included."""
    import bpy

    mesh = body.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    out = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", out)
    return out.reshape(-1, 3).astype(float) * 1000
