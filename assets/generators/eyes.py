# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference eyes: the eye part of `sim.anatomy.eyeball` behind the lid margins, left and right."""

import numpy as np

from ...sim.anatomy.eyeball import eye_mesh
from ...sim.anatomy.head import Eye
from ...sim.mesh import Mesh
from .eye_frame import eye_frames


def make_eyes(
    skin: Mesh, groups: dict[str, np.ndarray], landmarks: dict[str, np.ndarray]
) -> tuple[tuple[Mesh, Mesh], tuple[Eye, Eye]]:
    """((left, right) eye parts in mm, (left, right) `Eye`) behind the lid margins of the reference skin."""
    frames = eye_frames(skin.vertices)
    meshes = [eye_mesh(eye, landmarks[f"en_{side}"]) for eye, side in zip(frames, "lr", strict=True)]
    return (meshes[0], meshes[1]), frames
