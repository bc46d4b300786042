# SPDX-License-Identifier: GPL-3.0-or-later
"""The eyeball as a table of rings: sclera, iris with pupil behind, a clear cornea over them, the caruncle beside.

Every eye of every head has these vertices in this order, so an iris or a pupil of another size is other positions of the
same vertices (`eye_of_size`) and can be a shape key. Sizes of the adult eye: globe 24 mm, limbus 11.7 mm (Rüfer 2005),
corneal radius 7.8 mm with asphericity -0.26, iris 3.1 mm behind the corneal apex (Gullstrand's schematic eye).
"""

import numpy as np

from ..errors import InputError
from ..mesh import Mesh
from .head import MATERIALS, Eye

#: Vertices of one ring.
AROUND = 32
#: Corneal radius at the apex, mm, and asphericity (a conic that flattens outward).
CORNEA, ASPHERICITY = 7.8, -0.26
CORNEA_THICKNESS = 0.5
#: Iris plane behind the corneal apex, mm.
CHAMBER = 3.1
#: Radii in mm that an iris and a pupil may have in a globe of 12 mm; the pupil leaves at least `RIM` of iris.
IRIS_RANGE, PUPIL_RANGE, RIM = (4.8, 6.8), (1.0, 4.2), 0.8

_SCLERA, _IRIS, _PUPIL, _DOME = 16, 6, 2, 6
_GLOBE_RINGS = _SCLERA + _IRIS + _PUPIL
_SHELL_RINGS = 2 * _DOME - 1
#: Vertices of globe and cornea: the rest of an eye's mesh stays with the lids.
BALL = (_GLOBE_RINGS + _SHELL_RINGS) * AROUND + 4


def dome(across, size: float = 1.0):
    """How far the cornea falls behind its apex, mm, at the distance ``across`` mm from the gaze; ``size``: globe / 12 mm."""
    radius = CORNEA * size
    return across**2 / (radius * (1 + np.sqrt(1 - (1 + ASPHERICITY) * across**2 / radius**2)))


def apex(eye: Eye) -> float:
    """mm from the eye's centre to the corneal apex."""
    size = eye.radius / 12.0
    return float(np.sqrt(eye.radius**2 - eye.iris_radius**2) + dome(eye.iris_radius, size))


def reach(eye: Eye, angle) -> np.ndarray:
    """mm from the eye's centre to its surface at ``angle`` rad from the gaze: the globe, or the cornea before it."""
    across = np.linspace(0, eye.iris_radius, 40)
    forward = apex(eye) - dome(across, eye.radius / 12.0)
    return np.interp(angle, np.arctan2(across, forward), np.hypot(across, forward), right=eye.radius)


def _rings(eye: Eye):
    """((rings (k, 2), first pole, last pole) of the globe, the same of the cornea): distance from the gaze, forward."""
    size, limbus, pupil = eye.radius / 12.0, eye.iris_radius, eye.pupil_radius
    start = np.arcsin(limbus / eye.radius)
    rim, top = eye.radius * np.cos(start), apex(eye)
    share = np.linspace(0, 1, _SCLERA + 1)[1:]
    back = np.pi + (start - np.pi) * (share + 0.12 * np.sin(np.pi * share))  # closer rings toward the limbus
    sclera = eye.radius * np.stack([np.sin(back), np.cos(back)], axis=1)
    plane = top - CHAMBER * size
    root = limbus - 0.45 * size
    along = np.linspace(0, 1, _IRIS - 1)
    relief = np.array([-0.02, 0.02, 0.06, 0.13, 0.0]) * size  # the collarette stands highest
    iris = np.stack([root + along * (pupil - root), plane + relief], axis=1)
    iris = np.concatenate([[(limbus - 0.1 * size, rim - 0.3 * size)], iris])
    hole = np.array([(0.96 * pupil, plane - 0.3 * size), (0.5 * pupil, plane - 0.5 * size)])
    globe = np.concatenate([sclera, iris, hole]), -eye.radius, plane - 0.5 * size
    share = np.linspace(1, 0, _DOME + 1)[:-1] ** 0.9
    outer = np.stack([share * limbus, top - dome(share * limbus, size)], axis=1)
    outer[0] = limbus + 0.1 * size, rim - 0.03 * size
    thick = CORNEA_THICKNESS * size
    inner = outer[1:][::-1] * [0.97, 1] - [0, thick]
    return globe, (np.concatenate([inner, outer]), top - thick, top)


def _turned(rings, first, last, side, up, forward, centre):
    """Rings turned about the gaze with their poles at the end, (k * AROUND + 2, 3) mm."""
    turn = 2 * np.pi * np.arange(AROUND) / AROUND
    circle = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * up
    body = rings[:, 0, None, None] * circle + rings[:, 1, None, None] * forward
    return np.concatenate([body.reshape(-1, 3), [first * forward, last * forward]]) + centre


def ball_vertices(eye: Eye, side: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(BALL, 3) mm: globe and cornea of ``eye``; ``side`` and ``up`` (3,) unit vectors across the gaze."""
    return np.concatenate([_turned(*table, side, up, eye.gaze, eye.centre) for table in _rings(eye)])


def ball_faces(mirrored: bool) -> tuple[np.ndarray, np.ndarray]:
    """Faces (m, 4) int32 and their material (m,) int16 (`MATERIALS`) of `ball_vertices`."""
    name = MATERIALS["eye_l"].index
    globe = [name("sclera")] * _SCLERA + [name("iris")] * _IRIS + [name("pupil")] * (_PUPIL + 1)
    faces, material, start = [], [], 0
    for count, kind in ((_GLOBE_RINGS, globe), (_SHELL_RINGS, [name("cornea")] * (_SHELL_RINGS + 1))):
        faces.append(lathe_faces(count, AROUND) + np.where(lathe_faces(count, AROUND) < 0, 0, start))
        material.append(np.repeat(np.array(kind, np.int16), AROUND))
        start += count * AROUND + 2
    every = np.concatenate(faces)
    return (flipped(every) if mirrored else every).astype(np.int32), np.concatenate(material)


def lathe_faces(count: int, around: int) -> np.ndarray:
    """(m, 4) faces of ``count`` rings of ``around`` vertices, closed by two poles after them; -1 last: a triangle."""
    j = np.arange(around)
    k = (j + 1) % around
    none = np.full(around, -1)
    faces = [np.stack([np.full(around, count * around), k, j, none], axis=1)]
    for i in range(count - 1):
        a, b = i * around, (i + 1) * around
        faces.append(np.stack([a + j, a + k, b + k, b + j], axis=1))
    a = (count - 1) * around
    faces.append(np.stack([np.full(around, count * around + 1), a + j, a + k, none], axis=1))
    return np.concatenate(faces)


def flipped(faces: np.ndarray) -> np.ndarray:
    """Faces (m, 4) turned inside out."""
    quad = faces[:, 3:] >= 0
    return np.where(quad, faces[:, [0, 3, 2, 1]], faces[:, [0, 2, 1, 3]])


def eye_of_size(vertices: np.ndarray, eye: Eye) -> np.ndarray:
    """(n, 3) mm: an eyeball's vertices with the iris and the pupil that ``eye`` says; pure, the mesh stays the same.

    vertices : (n, 3) mm of an eye part, looking along ``eye.gaze`` about ``eye.centre``, turned about it in any way.

    Raises
    ------
    InputError : the mesh is not an eye of this version, or the radii are impossible.
    """
    if len(vertices) < BALL:
        raise InputError("This eye was made by another version of Head Shop: rebuild the head to change its iris.")
    size = eye.radius / 12.0
    low, high = (size * x for x in IRIS_RANGE)
    if not low <= eye.iris_radius <= high:
        raise InputError(
            f"An iris of {eye.iris_radius:.2f} mm does not fit this eye: choose {low:.1f} to {high:.1f} mm."
        )
    most = min(size * PUPIL_RANGE[1], eye.iris_radius - size * RIM)
    if not size * PUPIL_RANGE[0] <= eye.pupil_radius <= most:
        raise InputError(
            f"A pupil of {eye.pupil_radius:.2f} mm does not fit this iris: choose {size * PUPIL_RANGE[0]:.1f} to {most:.1f} mm."
        )
    side = _across(vertices[(_SCLERA - 1) * AROUND] - eye.centre, eye.gaze)
    up = _across(vertices[(_SCLERA - 1) * AROUND + AROUND // 4] - eye.centre, eye.gaze)
    return np.concatenate([ball_vertices(eye, side, up), vertices[BALL:]])


def _across(vector, gaze):
    flat = vector - (vector @ gaze) * gaze
    return flat / np.linalg.norm(flat)


def turned_eye(vertices: np.ndarray, centre: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """(n, 3) mm: an eye part with its ball turned by ``rotation`` (3, 3); the caruncle stays where it is."""
    out = np.array(vertices, dtype=float)
    ball = out[:BALL] if len(out) > BALL else out
    ball[:] = (ball - centre) @ rotation.T + centre
    return out


def eye_mesh(eye: Eye, lower: np.ndarray, upper: np.ndarray) -> Mesh:
    """The eye part: the ball looking along ``eye.gaze``, and the caruncle in the inner corner of the lids.

    lower, upper : (k, 3) mm, the lids' backs from the inner corner outward (`caruncle`). The right eye (corner on the
    subject's left of the ball) is the mirror image of the left one.
    """
    from .caruncle import caruncle

    up = _across(np.array([0.0, 0.0, 1.0]), eye.gaze)
    left = np.cross(up, -eye.gaze) * -1.0
    mirrored = float((lower[0] - eye.centre) @ left) > 0
    vertices = ball_vertices(eye, -left if mirrored else left, up)
    faces, material = ball_faces(mirrored)
    piece = caruncle(eye, lower, upper)
    return Mesh(
        np.concatenate([vertices, piece.vertices]),
        np.concatenate([faces, piece.faces + len(vertices)]).astype(np.int32),
        material=np.concatenate([material, np.full(len(piece.faces), MATERIALS["eye_l"].index("caruncle"), np.int16)]),
    )
