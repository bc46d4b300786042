# SPDX-License-Identifier: GPL-3.0-or-later
"""Scans as objects in the scene: brought in, adopted, given landmarks, made into heads.

A scan object is always clean, in metres, upright and facing -Y in its own space; ``headshop_turn`` says by which
rotation the axes of its file became these, so that landmark files stay in the file's axes. Where an artist moves the mesh in
that space, landmarks and axes go with it (`mesh_follow`).
"""

import json
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..sim.adapt.landmarks import read_landmark_file, write_landmarks
from ..sim.anatomy.landmark_names import SKIN
from ..sim.errors import InputError
from ..sim.landmarks.find import FoundLandmarks
from ..sim.progress import Work, finish
from ..sim.scan.orientation import FOUND, Orientation, axis_names, detect, read_as
from ..sim.scan.units import BY_FACE, PLAUSIBLE, UNITS, USUAL, unit_words
from . import bridge, heads, heat_map, mesh_follow, pipeline, scan_landmarks
from .mesh_follow import TURN
from .shown_objects import as_one

IN_PLACE = "headshop_in_place"  # whether the scan stands in the place of an object that it was adopted from
ROUNDED = 1e-6  # between two scales that are one


def import_scan(context, path, unit: str | None = None, up: str | None = None) -> Work:
    """Work that reads a scan file into the scene and chooses it; returns the object.

    Raises
    ------
    InputError : the file cannot be read or is no head.
    """
    scan = yield from pipeline.load_scan(path, None, unit, up)
    return _add(context, scan, Path(path).stem)


def add_sample(context, sample, with_landmarks: bool = True) -> bpy.types.Object:
    """Put the sample subject's scan into the scene, cleaned like any other, and choose it; returns the object."""
    scan = finish(pipeline.prepare_scan(sample.scan, sample.landmarks))
    obj = _add(context, scan, "Sample")
    if with_landmarks:
        turned = scan.orientation.turn(sample.landmarks)
        scan_landmarks.replace(obj, {name: p for name, p in turned.items() if name in SKIN})
    return obj


def adopt(context, originals: list[bpy.types.Object]) -> Work:
    """Work that makes a clean, upright copy of meshes or point clouds the scan, in their place, and hides those; returns it.

    It is what the viewport shows: with modifiers and shape keys, and as wide, high, deep or mirrored as scales make it. It is
    called after the first, and stands as that does. Its unit is told by its numbers before the first's scale, as those are of a
    file, or, where they are no head's, by the size that it has in the scene.

    Raises
    ------
    InputError : they are no head (`sim.scan.clean`, `sim.scan.orientation`), or the first is scaled to nothing.
    """
    mesh, place = as_one(context, originals)
    factor = bridge.METRES * _scale_that_tells(mesh, place)  # importers put the numbers of a file, in whatever unit
    scan = yield from pipeline.prepare_scan(mesh.moved(mesh.vertices * factor))
    obj = _add(context, scan, f"{originals[0].name} Scan")
    turn = factor * scan.orientation.matrix  # mm to mm: the translation is zero, so it serves for metres too
    turn[3, 3] = 1.0
    obj.matrix_world = place @ Matrix(np.linalg.inv(turn).tolist())
    obj[IN_PLACE] = True
    for original in originals:
        original.hide_set(True)
    look_at(context)
    return obj


def _scale_that_tells(mesh, place) -> float:
    """By which the numbers of ``mesh`` are multiplied to tell their unit: 1 where they are a head's in some metric unit, as
    those of a file are whatever an artist has scaled it by; else by what they are scaled in the scene, if a head is shown."""
    scale = abs(place.determinant()) ** (1 / 3)
    extent = bridge.METRES * np.ptp(mesh.vertices, axis=0).max() if len(mesh.vertices) else 0.0
    metric = [unit for name, unit in UNITS.items() if name != "in"]
    own, shown = (
        any(PLAUSIBLE[0] < size * unit < PLAUSIBLE[1] for unit in metric) for size in (extent, scale * extent)
    )
    return scale if shown and not own else 1.0


def _add(context, scan, name: str) -> bpy.types.Object:
    obj = pipeline.add_scan(scan, name, context.scene)
    obj[heads.REPORT] = json.dumps({"scan": scan.report})
    obj[TURN] = scan.orientation.rotation.ravel().tolist()
    scan_landmarks.entries(obj)
    context.scene.headshop.scan = obj
    select(context, obj)
    _clear_view(context, obj)
    look_at(context)
    return obj


def unit_is_told(scan: bpy.types.Object) -> bool:
    """Whether an artist said in which unit the ``scan`` is, so that its size is not questioned."""
    return bool(heads.read_report(scan).get("scan", {}).get("unit_told", True))


def usual_scales(scan: bpy.types.Object) -> list[float]:
    """How many times as large the ``scan`` is in each usual unit as in the one that its file was read in."""
    own = heads.read_report(scan).get("scan", {}).get("unit_scale", 1.0)
    return [scale / own for scale in USUAL]


def resize(scan: bpy.types.Object, factor: float) -> str:
    """Make the ``scan``, which is of no known unit, ``factor`` times as large, with the landmarks on it; returns why, in a few
    words."""
    larger = np.diag([factor] * 3 + [1.0])
    _transform(scan, larger)
    axes = mesh_follow.file_axes(scan) @ np.linalg.inv(larger)  # what is a millimetre in its file grew as well
    mesh_follow.write_file_axes(scan, axes)
    facts = heads.read_report(scan).get("scan", {})
    scale = factor * facts.get("unit_scale", 1.0)
    name = next((name for name, usual in UNITS.items() if abs(scale / usual - 1) < ROUNDED), BY_FACE)
    facts |= {"unit": name, "unit_scale": scale, "sheets_apart_mm": factor * facts.get("sheets_apart_mm", 0.0)}
    facts["orientation"] = f"Read as {unit_words(facts['unit'], facts['unit_scale'])}."
    heads.write_report(scan, {"scan": facts})
    return "no person's size" if name == BY_FACE else f"it is in {unit_words(name, scale)}"


def stand_upright(scan: bpy.types.Object, found: FoundLandmarks) -> FoundLandmarks:
    """Turn the ``scan`` as the landmarks ``found`` on it tell (`sim.scan.orientation`), unless an artist said which way is up;
    returns them on what it is then.

    Without them a face is laid on all of the scan, which in bodies and rooms lies anywhere. What was adopted stays in its
    original's place.
    """
    facts = heads.read_report(scan).get("scan", {})
    if facts.get("up_told", True):
        return found
    turn = detect(bridge.scan_mesh(scan), found.positions, unit=1.0, called=facts["unit"]).rotation
    if np.allclose(turn, np.eye(3)):
        return found
    matrix = np.eye(4)
    matrix[:3, :3] = turn
    _transform(scan, matrix)
    if scan.get(IN_PLACE):
        scan.matrix_world = scan.matrix_world @ Matrix(matrix.T.tolist())
    left, _, right = np.linalg.svd(mesh_follow.file_axes(scan)[:3, :3])
    whole = left @ right  # the turn alone, without a scale that an artist applied
    up, front = axis_names(whole)
    said = f"{read_as(facts['unit'], facts['unit_scale'], whole)}: {FOUND} say so."
    facts |= {"up": up, "front": front, "rotation": whole.tolist(), "certain": True, "orientation": said}
    heads.write_report(scan, {"scan": facts})
    return found.placed({name: turn @ place for name, place in found.positions.items()})


def _transform(scan, matrix) -> None:
    """Move the mesh of the ``scan`` and what is kept on it by a ``matrix`` (4, 4) in its own space, about the origin."""
    mesh_follow.settle(scan)
    scan.data.transform(Matrix(matrix.tolist()), shape_keys=True)
    mesh_follow.carry(scan, matrix)


def _clear_view(context, obj) -> None:
    """Hide meshes that stand around the scan, such as the cube of a new file: inside them it could not be seen."""
    context.view_layer.update()
    low, high = _bounds(obj)
    for other in context.visible_objects:
        if other.type == "MESH" and other is not obj:
            a, b = _bounds(other)
            if (a <= low).all() and (b >= high).all():
                other.hide_set(True)


def _bounds(obj) -> tuple[np.ndarray, np.ndarray]:
    corners = np.array([obj.matrix_world @ Vector(corner) for corner in obj.bound_box])
    return corners.min(axis=0), corners.max(axis=0)


def _upright() -> Orientation:
    """The orientation of what is upright already."""
    return Orientation("mm", 1.0, "+Z", "-Y", np.eye(3), True, "Upright already.")


def select(context, obj: bpy.types.Object) -> None:
    """Make ``obj`` the only selected and the active object."""
    for other in context.view_layer.objects.selected:
        other.select_set(False)
    obj.select_set(True)
    context.view_layer.objects.active = obj


def look_at(context) -> None:
    """Turn the viewport to the front of what is selected and close to it, all four of a quad view; nothing without a window."""
    area = context.area
    if bpy.app.background or area is None or area.type != "VIEW_3D":
        return
    region = next(region for region in area.regions if region.type == "WINDOW")
    with context.temp_override(area=area, region=region):
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_selected(use_all_regions=True)


def summary(scan: bpy.types.Object) -> str:
    """A sentence about a scan that came in."""
    report = json.loads(scan.get(heads.REPORT, "{}")).get("scan", {})
    made = f", made of {report['points']:,} points" if report.get("points") else ""
    if report.get("sheets"):
        made += f", {report['sheets']} sheets laid onto each other"
    return f"{scan.name}: {len(scan.data.polygons):,} faces{made}. {report.get('orientation', '')}".strip()


def load_landmarks(scan: bpy.types.Object, path) -> int:
    """Replace the scan's landmarks by those of a file (mm, in the axes of the scan's file); returns how many.

    Raises
    ------
    InputError : the file cannot be used (`sim.adapt.landmarks`).
    """
    file = read_landmark_file(path)
    mesh_follow.settle(scan)
    axes = mesh_follow.file_axes(scan)
    read = {name: mesh_follow.moved(axes, place) for name, place in file.positions.items() if name in SKIN}
    scan_landmarks.replace(scan, read, file.found)
    return len(read)


def save_landmarks(scan: bpy.types.Object, path) -> int:
    """Write the placed landmarks, and the found ones that are sure enough, to a file.

    They are in the axes of the scan's file; returns how many.
    """
    mesh_follow.settle(scan)
    back = np.linalg.inv(mesh_follow.file_axes(scan))
    placed = scan_landmarks.to_build(scan)
    missing = [n for n in SKIN if n not in placed]
    in_file = {n: mesh_follow.moved(back, p) for n, p in placed.items()}
    write_landmarks(path, in_file, missing, scan_landmarks.nobody_placed(scan))
    return len(placed)


def build(context, scan: bpy.types.Object, name: str = "") -> Work:
    """Build a head from a scan object and its placed landmarks; returns (skin object, report).

    The scene is left alone until everything is computed. The scan is hidden then: the head stands in its place.

    Raises
    ------
    InputError : too few landmarks, or they do not fit the scan.
    """
    mesh_follow.settle(scan)
    placed = scan_landmarks.to_build(scan)
    if len(placed) < scan_landmarks.ENOUGH_TO_BUILD:
        raise InputError(f"{scan.name} has {len(placed)} landmarks: place at least {scan_landmarks.ENOUGH_TO_BUILD}.")
    report = json.loads(scan.get(heads.REPORT, "{}")).get("scan", {})
    prepared = pipeline.Scan(bridge.scan_mesh(scan), _upright(), report)
    skin, report = yield from pipeline.build(
        prepared,
        placed,
        name or scan.name.removesuffix(" Scan"),
        scan,
        context.scene,
        relax=context.scene.headshop.relax.lower(),
        leave_out=",".join(sorted(context.scene.headshop.no_skin)).lower() or "never",
        found=scan_landmarks.nobody_placed(scan),
    )
    skin.matrix_world = scan.matrix_world
    scan.hide_viewport = True
    _take_over(context.scene, scan, skin)
    context.scene.headshop.head = skin
    select(context, skin)
    return skin, report


def _take_over(scene, scan, skin) -> None:
    """Let the head of ``skin`` stand where others of its ``scan`` did, which are hidden, and show its fit if theirs was shown:
    the colours that show one head's fit are no colours of another."""
    shown = [other for other in heads.find_heads(scene) if other != skin and other.headshop.show_fit]
    for other in shown:
        other.headshop.show_fit = False
    if shown and heat_map.has_fit(skin):
        skin.headshop.show_fit = True
    for other in heads.built_from(scene, scan):
        if other != skin:
            heads.hide(other, scene)
