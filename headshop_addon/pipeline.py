# SPDX-License-Identifier: GPL-3.0-or-later
"""From a scan file and landmarks to a head in the scene: the one path that operators and the command line share."""

from collections.abc import Collection
from contextlib import contextmanager
from dataclasses import dataclass, field

import bpy
import numpy as np

from ..sim.adapt.build import build_head
from ..sim.anatomy.storage import reference_head
from ..sim.detail.maps import SIZE
from ..sim.landmarks.find import find_landmarks
from ..sim.mesh import Mesh
from ..sim.progress import Progress, Work, portion
from ..sim.scan.clean import cleaning
from ..sim.scan.orientation import Orientation, detect, detecting
from ..sim.scan.units import BY_FACE, UNITS, plausible_units
from . import bridge, heads, shape_keys
from .detail_images import packing
from .materials import dressing
from .provenance import timed, versions
from .scan_import import datablocks, read_scan
from .scan_texture import put_pictures


@dataclass(frozen=True, eq=False)
class Scan:
    """A cleaned scan in mm, Z up, face toward -Y.

    orientation : how points of its file got there
    report : the ``scan`` block of ``report.json``
    """

    mesh: Mesh
    orientation: Orientation
    report: dict = field(default_factory=dict)
    seconds: dict = field(default_factory=dict)


def load_scan(path, landmarks: dict | None = None, unit: str | None = None, up: str | None = None) -> Work:
    """Work returning the `Scan` of a file: read, cleaned and turned upright.

    landmarks : name -> (3,) mm along the file's own axes; they help to find the axes, see `Orientation.turn`
    unit, up : override what is detected: a name in `units.UNITS` or mm per unit, an axis such as ``+Y``

    Raises
    ------
    InputError : the file cannot be read or is no head (`scan_import`, `sim.scan.clean`, `sim.scan.orientation`).
    """
    seconds: dict[str, float] = {}
    yield Progress(0.0, "Reading the scan")
    with timed(seconds, "read"):
        raw = read_scan(path)
    with timed(seconds, "clean"):
        return (yield from portion(prepare_scan(raw, landmarks, unit, up, seconds), 0.4, 1.0))


def prepare_scan(raw: Mesh, landmarks=None, unit=None, up=None, seconds=None) -> Work:
    """Work that cleans a mesh in any unit and axes and brings it to mm, Z up, face toward -Y; see `load_scan`."""
    mesh, counts = yield from portion(cleaning(raw), 0.0, 0.5)
    found = yield from portion(detecting(mesh, landmarks, unit=unit, up=up), 0.5, 1.0)
    return _upright(mesh, counts, found, unit, up, seconds)


def _upright(mesh, counts, found, unit, up, seconds):
    apart = counts.pop("sheets_apart")
    report = counts | {
        "sheets_apart_mm": apart * found.unit_scale,
        "unit": found.unit,
        "unit_scale": found.unit_scale,
        "unit_told": unit is not None,
        "up_told": up is not None,
        "up": found.up,
        "front": found.front,
        "rotation": found.rotation.tolist(),
        "certain": bool(found.certain),
        "orientation": found.reason,
    }
    return Scan(mesh.moved(found.apply(mesh.vertices)), found, report, {} if seconds is None else seconds)


def load_scan_alone(path, unit: str | None = None, up: str | None = None) -> Work:
    """`load_scan` where nobody gives landmarks: Work returning (scan, found landmarks), both in the scan's upright place.

    The landmarks are found in the scan as it is, in any turn and unit, and tell its axes.

    Raises
    ------
    InputError : the file cannot be read, is no head, or shows no face.
    """
    seconds: dict[str, float] = {}
    yield Progress(0.0, "Reading the scan")
    with timed(seconds, "read"):
        raw = read_scan(path)
    with timed(seconds, "clean"):
        mesh, counts = yield from portion(cleaning(raw), 0.02, 0.05)
    with timed(seconds, "landmarks"):
        units = plausible_units(mesh, unit)
        work = find_landmarks(mesh, unit_scales=list(units.values()), any_size=unit is None)
        found = yield from portion(work, 0.05, 1.0)
        name = next((name for name, scale in (units | UNITS).items() if scale == found.unit_scale), BY_FACE)
        axes = detect(mesh, found.positions, unit=found.unit_scale, up=up, called=name, picked=False)
    return _upright(mesh, counts, axes, unit, up, seconds), found.placed(axes.turn(found.positions))


def add_scan(scan: Scan, name: str, scene: bpy.types.Scene | None = None) -> bpy.types.Object:
    """Put a scan into the scene as an object at the origin, in metres."""
    obj = bridge.mesh_to_object(scan.mesh, name)
    put_pictures(obj, scan.mesh)
    obj[heads.PART] = "scan"
    heads.write_report(obj, {"scan": scan.report})
    (scene or bpy.context.scene).collection.objects.link(obj)
    return obj


def build(
    scan: Scan,
    landmarks: dict[str, np.ndarray],
    name: str,
    scan_object: bpy.types.Object | None = None,
    scene: bpy.types.Scene | None = None,
    detail: int = SIZE,
    relax: str = "auto",
    leave_out: str = "auto",
    found: Collection[str] = (),
) -> Work:
    """Fit the reference head to ``scan`` and put it into the scene; returns (skin object, report).

    ``landmarks`` are in the scan's place (mm); ``detail`` is the side of the detail maps in pixels, 0 for none.
    ``relax`` is one of `sim.relax.choice.CHOICES`; a face that is relaxed keeps itself as scanned in a shape key.
    ``leave_out`` is what `sim.adapt.scan_surface.to_leave_out` reads; ``found`` names the landmarks that nobody picked.
    Closing the generator leaves the scene as it was.

    Raises
    ------
    InputError : the landmarks do not fit the scan (`sim.adapt`).
    """
    seconds = dict(scan.seconds)
    with timed(seconds, "fit"):
        yield Progress(0.0, "Reading the reference head")
        reference = reference_head()
        work = build_head(reference, scan.mesh, landmarks, detail, relax, leave_out, found)
        result = yield from portion(work, 0.02, 0.9)
    yield Progress(0.9, "Placing the head")
    report = {
        "scan": scan.report,
        "fit": result.fit,
        "anatomy": result.anatomy,
        "landmarks_missing": list(result.landmarks_missing),
        "seconds": seconds,
        "versions": versions(),
    }
    with timed(seconds, "place"), _taken_back(scan_object):
        created = scan_object is None
        if created:
            scan_object = add_scan(scan, f"{name} Scan", scene)
        collection = heads.create_head(result.head, name, scan_object, scene=scene, attributes=result.attributes)
        if created:  # it lives with its head
            (scene or bpy.context.scene).collection.objects.unlink(scan_object)
            scan_object.hide_viewport = True
        skin = next(obj for obj in collection.objects if heads.is_skin(obj))
        for child in collection.children:
            child.hide_viewport = True  # muscles: they stay where they are when the face moves
        if result.scanned is not None:
            shape_keys.keep_as_scanned(skin, result.scanned)
        if result.detail is not None:
            yield from portion(packing(skin, result.detail), 0.92, 0.94)
        yield from portion(dressing(skin), 0.94, 1.0)
    heads.write_report(skin, report)
    return skin, report


def build_file(path, landmarks, name: str, unit=None, up=None, **options) -> Work:
    """A scan file and landmarks (mm along the file's own axes) to a head; returns what `build` does, to which further
    ``options`` go.

    Raises
    ------
    InputError : the file cannot be read, is no head, or the landmarks do not fit it.
    """
    scan = yield from portion(load_scan(path, landmarks, unit, up), 0.0, 0.1)
    return (yield from portion(build(scan, scan.orientation.turn(landmarks), name, **options), 0.1, 1.0))


def build_alone(path, name: str, unit: str | None = None, up: str | None = None, **options) -> Work:
    """A scan file to a head without anybody's landmarks; returns what `build` does, to which further
    ``options`` go.

    Raises
    ------
    InputError : the file cannot be read, is no head, or shows no face.
    """
    scan, found = yield from portion(load_scan_alone(path, unit, up), 0.0, 0.35)
    sure = found.sure()
    skin, report = yield from portion(build(scan, sure, name, found=sure, **options), 0.35, 1.0)
    if found.doubt:
        report["fit"]["advice"] = " ".join(filter(None, (found.doubt, report["fit"]["advice"])))
        heads.write_report(skin, report)
    return skin, report


@contextmanager
def _taken_back(scan_object: bpy.types.Object | None):
    """If the work inside fails or is cancelled, whatever it added to the file goes."""
    before = datablocks()
    seen = None if scan_object is None else (scan_object.hide_render, scan_object.get(heads.PART))
    try:
        yield
    except BaseException:
        bpy.data.batch_remove(datablocks() - before)
        if seen is not None:
            scan_object.hide_render, scan_object[heads.PART] = seen[0], seen[1] or "scan"
        raise
