# SPDX-License-Identifier: GPL-3.0-or-later
"""Eyeballs: sclera, iris with pupil behind, and a clear cornea over them.

Sizes of the adult eye: globe 24 mm, limbus 11.7 mm (Rüfer 2005), corneal radius 7.8 mm flattening outward, iris 3.1 mm
behind the corneal apex (Gullstrand's schematic eye).
"""

import numpy as np

from ...sim.anatomy.head import MATERIALS, Eye
from ...sim.mesh import Mesh
from .eye_frame import eye_frames

LIMBUS = 5.85
PUPIL = 1.9
#: Corneal apex beyond the globe, mm: a little less than life, so that lids slide over it.
BULGE = 1.3
CORNEA_THICKNESS = 0.5
AROUND = 32


def make_eyes(
    skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray]
) -> tuple[tuple[Mesh, Mesh], tuple[Eye, Eye]]:
    """((left, right) eyeball meshes in mm, (left, right) `Eye`) behind the lid margins of the reference skin."""
    frames = eye_frames(skin.vertices)
    left = eyeball(frames[0].radius)
    meshes = [_placed(left, eye) for eye in frames]
    return (meshes[0], meshes[1]), frames


def eyeball(radius: float) -> Mesh:
    """An eyeball of ``radius`` mm about the origin, looking along -Y: a closed globe and a closed cornea before it.

    Materials index `MATERIALS["eye_l"]`.
    """
    name = MATERIALS["eye_l"].index
    limbus = np.arcsin(LIMBUS / radius)
    rim = radius * np.cos(limbus)
    # Profiles of (distance from the axis, forward): sclera from the rear pole, then the iris and the pupil.
    back = np.linspace(np.pi, limbus, 15)[1:]
    sclera = np.stack([radius * np.sin(back), radius * np.cos(back)], axis=1)
    plane = radius + BULGE - 3.1
    iris = np.array([(5.6, rim - 0.35), (5.3, plane - 0.45), (4.2, plane - 0.15), (3.0, plane), (PUPIL, plane - 0.05)])
    pupil = np.array([(PUPIL - 0.08, plane - 0.35), (0.9, plane - 0.5)])
    rings = np.concatenate([sclera, iris, pupil])
    kind = [name("sclera")] * len(sclera) + [name("iris")] * len(iris) + [name("pupil")] * (len(pupil) + 1)
    globe = _lathe(rings, -radius, plane - 0.5, kind)
    share = np.linspace(1, 0, 7)[:-1]
    apex = radius + BULGE
    dome = rim + (apex - rim) * (1 - share**2) ** 0.5 * (1 - 0.08 * share**2 * (1 - share))
    outer = np.stack([share * (LIMBUS + 0.12), np.where(share == 1, rim - 0.02, dome)], axis=1)
    inner = np.stack([share[1:] * (LIMBUS - 0.12), dome[1:] - CORNEA_THICKNESS], axis=1)[::-1]
    shell = _lathe(
        np.concatenate([inner, outer]), apex - CORNEA_THICKNESS, apex, [name("cornea")] * (len(inner) + len(outer) + 1)
    )
    return Mesh(
        np.concatenate([globe.vertices, shell.vertices]),
        np.concatenate([globe.faces, np.where(shell.faces >= 0, shell.faces + len(globe.vertices), -1)]),
        material=np.concatenate([globe.material, shell.material]),
    )


def _lathe(rings, first, last, kind):
    """Rings (k, 2) of (radius, forward) turned about the axis, closed by poles at ``first`` and ``last``.

    ``kind``: material of the k + 1 bands, from the first pole on.
    """
    turn = 2 * np.pi * np.arange(AROUND) / AROUND
    circle = np.stack([np.cos(turn), np.zeros(AROUND), np.sin(turn)], axis=1)
    body = rings[:, 0, None, None] * circle[None] - rings[:, 1, None, None] * np.array([0.0, 1.0, 0.0])
    vertices = np.concatenate([body.reshape(-1, 3), [[0, -first, 0], [0, -last, 0]]])
    count = len(rings)
    j = np.arange(AROUND)
    k = (j + 1) % AROUND
    faces = [np.stack([np.full(AROUND, count * AROUND), k, j, np.full(AROUND, -1)], axis=1)]
    for i in range(count - 1):
        a, b = i * AROUND, (i + 1) * AROUND
        faces.append(np.stack([a + j, a + k, b + k, b + j], axis=1))
    a = (count - 1) * AROUND
    faces.append(np.stack([np.full(AROUND, count * AROUND + 1), a + j, a + k, np.full(AROUND, -1)], axis=1))
    material = np.repeat(np.array(kind[: count + 1], np.int16), AROUND)
    return Mesh(vertices, np.concatenate(faces).astype(np.int32), material=material)


def _placed(mesh, eye):
    # Both eyes look straight ahead; mirroring keeps them an exact pair.
    side = 1.0 if eye.centre[0] > 0 else -1.0
    faces = mesh.faces
    if side < 0:
        quad = faces[:, 3] >= 0
        faces = np.where(quad[:, None], faces[:, [0, 3, 2, 1]], faces[:, [0, 2, 1, 3]])
    return Mesh(mesh.vertices * [side, 1, 1] + eye.centre, faces, material=mesh.material)
