# SPDX-License-Identifier: GPL-3.0-or-later
"""Range maps in the generic head's own frame and size, so that generic and subject lie texel on texel."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ..anatomy.head import Head
from ..mesh import Mesh
from ..mesh_subdivision import drawn
from .axis import upright_axis
from .pose import Pose
from .range_map import RangeMap, resample
from .relaxation import filled

#: Columns and rows of the maps that features are looked for in: texels of about 1.5 mm.
WIDTH, HEIGHT = 360, 176
#: Heights on the generic head, mm: from the throat to the crown.
SPAN = (-130.0, 134.0)


@dataclass(frozen=True, eq=False)
class Canonical:
    """A head's range map in the generic head's frame: the voids kept (``raw``) and relaxed (``full``)."""

    raw: RangeMap
    full: RangeMap


def canonical(mesh: Mesh, reference: Head, pose: Pose | None = None) -> Canonical:
    """The maps of ``mesh`` (mm), seen along the axis of the generic head as ``pose`` lays it on the mesh."""
    origin = upright_axis(reference.skin.vertices)
    if pose is None:
        pose = Pose(np.eye(3), np.zeros(3), 1.0, 0.0)
    size = pose.scale
    raw = resample(
        mesh,
        WIDTH,
        HEIGHT,
        origin=pose.apply(origin[None])[0],
        axes=pose.rotation.T,
        span=(size * SPAN[0], size * SPAN[1]),
    )
    return Canonical(raw, filled(raw, tension=1.0))


def generic(reference: Head) -> Canonical:
    """The generic head's own maps, as its skin is drawn, without what no scanner sees."""
    return _generic(reference)


@lru_cache(maxsize=2)
def _generic(reference: Head) -> Canonical:
    return canonical(drawn_skin(reference), reference)


def drawn_skin(reference: Head, warp=None) -> Mesh:
    """The skin as it is drawn, without what no scanner sees; ``warp`` moves points (n, 3)."""
    skin = reference.skin
    outer = np.asarray(reference.groups["inner"]) < 0.5
    faces = skin.faces[np.where(skin.faces >= 0, outer[skin.faces], True).all(axis=1)]
    vertices = drawn(skin.faces, skin.vertices)
    vertices = vertices if warp is None else warp(vertices)
    return replace(skin, vertices=vertices, faces=faces, uv=None, material=None)
