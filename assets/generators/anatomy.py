# SPDX-License-Identifier: GPL-3.0-or-later
"""All that lies under a reference skin: bone, eyes, teeth, tongue, muscles, made each in its turn."""

from dataclasses import dataclass, replace

import numpy as np

from ...sim.anatomy.head import Eye, Jaw, Muscle, SurfacePoints
from ...sim.mesh import Mesh
from ...sim.progress import Progress, Work


@dataclass(frozen=True, eq=False)
class Anatomy:
    """What `make_anatomy` returns: every part but the skin, and what ties them together (see `Head`)."""

    parts: dict[str, Mesh]
    skull_landmarks: SurfacePoints
    muscles: tuple[Muscle, ...]
    jaw: Jaw
    eyes: tuple[Eye, Eye]


def make_anatomy(skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray]) -> Work:
    """Work returning the `Anatomy` under ``skin``.

    Parameters
    ----------
    skin : the reference skin, mm, origin midway between the tragia, symmetric about x = 0
    groups : skin vertex group (`sim.anatomy.head.SKIN_GROUPS`) -> (n,) weights 0..1
    landmarks : the 60 of `sim.anatomy.landmark_names.SKIN` -> (3,) mm
    """
    from . import eyes, mandible, muscles, skull, teeth, tongue
    from .bone_cover import covered
    from .steps import rounded, stepped

    yield Progress(0.0, "Skull")
    cranium = covered(skull.make_skull(skin, groups, landmarks), skin, groups["inner"])
    yield Progress(0.4, "Mandible")
    jaw_bone = covered(mandible.make_mandible(skin, groups, landmarks), skin, groups["inner"])
    jaw = mandible.make_jaw(skin, groups, landmarks)
    points = skull.make_skull_landmarks(skin, groups, landmarks, cranium, jaw_bone)
    yield Progress(0.6, "Eyes, teeth, tongue")
    eye_meshes, eye_frames = eyes.make_eyes(skin, groups, landmarks)
    upper, lower = teeth.make_teeth(skin, groups, landmarks)
    jaw = replace(jaw, incisor=teeth.incisor_edge(lower))
    parts = {
        "skull": cranium,
        "mandible": jaw_bone,
        "eye_l": eye_meshes[0],
        "eye_r": eye_meshes[1],
        "teeth_upper": upper,
        "teeth_lower": lower,
        "tongue": tongue.make_tongue(skin, groups, landmarks, upper, lower),
    }
    yield Progress(0.7, "Muscles")
    parts, jaw, eye_frames = {name: rounded(mesh) for name, mesh in parts.items()}, stepped(jaw), stepped(eye_frames)
    bones = {name: mesh.vertices for name, mesh in parts.items()}
    marks = stepped(points.on(bones))
    made = muscles.make_muscles(skin, groups, landmarks, parts, marks, jaw, eye_frames)
    return Anatomy(parts, points, made, jaw, eye_frames)
