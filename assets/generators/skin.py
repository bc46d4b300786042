# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference skin: layout, shape, regions, landmarks and texture coordinates put together."""

from dataclasses import dataclass

import numpy as np

from ...sim.anatomy.head import SurfacePoints
from ...sim.mesh import Mesh
from .skin_features import feature_mesh
from .skin_finish import finish_shape
from .skin_groups import skin_groups
from .skin_landmarks import skin_landmarks
from .skin_layout import skin_layout
from .skin_shape import landmark_seeds, mean_shape
from .skin_uv import skin_uv
from .steps import stepped


@dataclass(frozen=True, eq=False)
class Skin:
    """What `make_skin` returns: mesh (mm), groups name -> (n,), landmarks, feature mesh (f, 3)."""

    mesh: Mesh
    groups: dict[str, np.ndarray]
    landmarks: SurfacePoints
    feature_mesh: np.ndarray


def make_skin(vertices: np.ndarray | None = None) -> Skin:
    """The reference skin; ``vertices`` (n, 3) mm replace the mean shape's (another head on the same layout)."""
    layout = skin_layout()
    vertices = stepped(finish_shape(layout, mean_shape()) if vertices is None else vertices)
    mesh = Mesh(
        vertices,
        layout.faces,
        uv=skin_uv(layout, vertices),
        material=np.zeros(len(layout.faces), dtype=np.int16),
    )
    groups = skin_groups(layout, vertices)
    landmarks = skin_landmarks(layout, vertices, mesh.triangles, groups["inner"], landmark_seeds())
    return Skin(mesh, groups, landmarks, feature_mesh(landmarks.on({"skin": vertices})))
