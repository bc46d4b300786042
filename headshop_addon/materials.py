# SPDX-License-Identifier: GPL-3.0-or-later
"""Dress a head: the attributes its materials read, and the materials themselves.

Materials are found by name in the file, so a second head shares them and an artist's changes to them stay.
"""

import bpy
import numpy as np
from scipy.spatial import cKDTree

from ..sim.anatomy.head import MATERIALS, Eye, Head, Muscle
from ..sim.mesh import Mesh
from ..sim.progress import Progress, Work, finish, portion
from ..sim.scan.iris_colour import iris_colour
from ..sim.scan.shown_skin import shown_skin
from . import bridge, heads, shape_keys
from .anatomy_materials import FIBRE, REST, anatomy_material
from .detail_images import images_of
from .eye_materials import EYE, IRIS, IRIS_COLOUR, eye_material
from .scan_colour import ScanColour, colour_image, unseen_skin
from .scan_texture import with_pictures
from .skin_material import COLOUR, skin_material
from .skin_paint import paint_skin, write_vectors

_EYE_KINDS = ("sclera", "iris", "pupil", "cornea", "caruncle")


def dress_head(skin: bpy.types.Object) -> None:
    """Give every part of a head its material, and the attributes that the materials read.

    Calling it again refreshes the attributes and replaces empty slots only.

    Raises
    ------
    InputError : not a whole head.
    """
    finish(dressing(skin))


def dressing(skin: bpy.types.Object) -> Work:
    """`dress_head` as work with progress."""
    yield Progress(0.0, "Dressing the head")
    head = heads.read_head(skin)
    axes = head_axes(head)
    scan, shown = _coloured_scan(skin), _as_scanned(skin, head)
    seen = None if scan is None else ScanColour(scan, shown.skin.vertices).turned_to(shown.skin)
    iris = None if seen is None else iris_colour(seen.scan, head.eyes)
    hidden, clothed = (bridge.read_attribute(skin.data, name) for name in ("hidden", "clothed"))
    if seen is not None:
        at = shown.landmark_positions()
        known = shown.skin, head.groups, at, head.eyes, hidden, seen.ends, clothed
        seen.trust = shown_skin(seen.points, seen.colour, *known)
    objects = heads.parts_of(skin)
    for part, obj in objects.items():
        mesh = head.parts[part]
        place = mesh.vertices @ axes.T
        if part == "skin":
            yield Progress(0.1, "Painting the skin")
            paint_skin(obj, mesh, head.groups, place, {n: axes @ p for n, p in head.landmark_positions().items()})
            unseen = unseen_skin(mesh, head.groups["inner"], hidden, clothed)
            own = yield from portion(_own_skin(skin, shown.skin, seen, unseen), 0.2, 0.85)
            yield Progress(0.85, "Dressing the head")
        elif part in ("eye_l", "eye_r"):
            write_vectors(obj.data, EYE, eye_coordinates(mesh, head.eyes[part == "eye_r"], axes[2]))
            colour = (*(IRIS_COLOUR if iris is None else iris), 1.0)
            write_vectors(obj.data, IRIS, np.tile(colour, (len(place), 1)))
        else:
            write_vectors(obj.data, REST, place)
        _fill_slots(obj, [own if part == "skin" and own else _material(kind) for kind in MATERIALS[part]])
    muscles = heads.muscles_of(skin)
    for muscle in head.muscles:
        if muscle.name in muscles:
            obj = muscles[muscle.name]
            write_vectors(obj.data, FIBRE, fibre_coordinates(muscle))
            _fill_slots(obj, [_material("muscle")])


def _as_scanned(skin: bpy.types.Object, head: Head) -> Head:
    """The ``head`` with the expression that it was scanned with: what its scan shows lies beside that, not the neutral face."""
    vertices = shape_keys.as_scanned(skin)
    return head if vertices is None else head.with_vertices({"skin": vertices})


def head_axes(head: Head) -> np.ndarray:
    """(3, 3) rows: the subject's left, back and up (Frankfurt horizontal) in the head's coordinates."""
    at = head.landmark_positions()
    left = at["t_l"] - at["t_r"]
    left /= np.linalg.norm(left)
    back = at["t_l"] + at["t_r"] - at["or_l"] - at["or_r"]
    back -= left * (back @ left)
    back /= np.linalg.norm(back)
    return np.array([left, back, np.cross(left, back)])


def _coloured_scan(skin: bpy.types.Object) -> Mesh | None:
    """The head's scan where the skin stands, mm in the skin's space; None if it has no colours or is gone."""
    scan = heads.scan_of(skin)
    if scan is None:
        return None
    bpy.context.view_layer.update()  # matrix_world of objects that were just made
    seen = with_pictures(bridge.scan_mesh(scan), scan)
    if seen.colour is None or not len(seen.faces):
        return None
    matrix = np.array(skin.matrix_world.inverted() @ scan.matrix_world)
    return seen.moved(seen.vertices @ matrix[:3, :3].T + matrix[:3, 3] / bridge.METRES)


def _own_skin(skin: bpy.types.Object, mesh: Mesh, seen: ScanColour | None, unseen: np.ndarray) -> Work:
    """Work returning a skin material of the head's own with its scan's colours and fine detail; None if there is
    neither."""
    name, image = heads.head_name(skin), None
    if seen is not None:
        painted = yield from colour_image(mesh, seen, unseen, f"{name} Colour")
        if painted is not None:
            image, colour = painted
            write_vectors(skin.data, COLOUR, np.column_stack([colour, np.ones(len(colour))]))
    detail = images_of(skin)
    if image is None and detail is None:
        return None
    return skin_material(f"Head Shop Skin {name}", image, detail)


def _material(kind: str) -> bpy.types.Material:
    if kind == "skin":
        return skin_material()
    return eye_material(kind) if kind in _EYE_KINDS else anatomy_material(kind)


def _fill_slots(obj: bpy.types.Object, materials: list[bpy.types.Material]) -> None:
    slots = obj.data.materials
    for index, material in enumerate(materials):
        if index >= len(slots):
            slots.append(material)
        elif slots[index] is None:
            slots[index] = material


def eye_coordinates(mesh: Mesh, eye: Eye, up: np.ndarray) -> np.ndarray:
    """(n, 3): across the gaze in iris radii, to the left and up; and the pupil's radius in iris radii."""
    gaze = eye.gaze / np.linalg.norm(eye.gaze)
    side = np.cross(up, -gaze)
    side /= np.linalg.norm(side)
    offset = mesh.vertices - eye.centre
    flat = np.column_stack([offset @ side, offset @ np.cross(-gaze, side)])
    flat[np.linalg.norm(flat, axis=1) < 1e-6] = 1e-6, 0.0  # the poles, too, lie to some side
    radius = np.linalg.norm(flat, axis=1)
    depth = offset @ gaze
    # behind the eye's equator go on outwards, so that veins do not return to the middle of the gaze
    flat *= ((radius + np.maximum(-depth, 0.0)) / np.maximum(radius, 1e-9))[:, None]

    def radii(kind: str) -> np.ndarray:
        """Radii of the vertices in front of the equator that faces of a material use."""
        faces = mesh.faces[mesh.material == MATERIALS["eye_l"].index(kind)] if mesh.material is not None else mesh.faces
        used = np.unique(faces[faces >= 0])
        return radius[used[depth[used] > 0]]

    # an iris may go on a little under the white: what is seen of it ends where the white begins
    iris = min(radii("iris").max(initial=0.0), radii("sclera").min(initial=np.inf))
    iris = iris if 0.2 * eye.radius < iris < 0.8 * eye.radius else 0.48 * eye.radius
    pupil = radii("pupil").max(initial=0.0)
    pupil = pupil if 0.1 * iris < pupil < 0.9 * iris else 0.38 * iris
    return np.column_stack([flat / iris, np.full(len(flat), pupil / iris)])


def fibre_coordinates(muscle: Muscle) -> np.ndarray:
    """(n, 3) for each vertex of a muscle's shape: 0..1 along its fibres, then mm across the belly and in depth."""
    fibres = muscle.fibres
    if muscle.ring:
        fibres = np.concatenate([fibres, fibres[:, :1]], axis=1)
    steps = np.linalg.norm(np.diff(fibres, axis=1), axis=2)
    length = np.concatenate([np.zeros((len(fibres), 1)), np.cumsum(steps, axis=1)], axis=1)
    along = length / np.maximum(length[:, -1:], 1e-9)
    # denser points than the fibres' own, so that the nearest one tells how far along we are
    count = 60
    wanted = np.linspace(0, 1, count)
    dense = np.array([[np.interp(wanted, a, f[:, k]) for k in range(3)] for a, f in zip(along, fibres, strict=True)])
    dense = dense.transpose(0, 2, 1)  # (fibres, count, 3)
    _, nearest = cKDTree(dense.reshape(-1, 3)).query(muscle.shape.vertices)
    where = wanted[nearest % count]
    # the local frame of the sheet: along the fibre, across the fibres, through the belly
    middle = dense.mean(axis=0)
    tangent = np.gradient(middle, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    spread = (dense[-1] - dense[0]) if len(dense) > 1 else np.broadcast_to(np.array([0.3, 0.2, 0.9]), middle.shape)
    spread = spread - tangent * (spread * tangent).sum(1, keepdims=True)
    spread /= np.maximum(np.linalg.norm(spread, axis=1, keepdims=True), 1e-9)
    through = np.cross(tangent, spread)
    step = nearest % count
    offset = muscle.shape.vertices - middle[step]
    if muscle.ring:
        where = np.full(len(where), 0.5)  # a ring has no tendon
    return np.column_stack([where, (offset * spread[step]).sum(1), (offset * through[step]).sum(1)])
