# SPDX-License-Identifier: GPL-3.0-or-later
"""What cuts what: pairs of triangles of one part, or of two, of which one pierces the other."""

from dataclasses import replace

import numpy as np

from ..anatomy.head import Head
from ..anatomy.teeth import crowns
from ..mesh import Mesh
from ..mesh_piercing import piercings, self_piercings
from ..mesh_subdivision import smoother

#: Parts of which none may cut another. Teeth stand in bone and gums lie on it, so those pairs are no fault.
APART = (
    *(("skin", part) for part in ("skull", "mandible", "eye_l", "eye_r", "teeth_upper", "teeth_lower", "tongue")),
    ("skull", "mandible"),
    *(("skull", part) for part in ("eye_l", "eye_r", "teeth_lower", "tongue")),
    *(("mandible", part) for part in ("teeth_upper", "tongue")),
    ("teeth_upper", "teeth_lower"),
    ("teeth_upper", "tongue"),
    ("teeth_lower", "tongue"),
)

#: Levels of subdivision at which the smooth skin is looked at.
LEVELS = 1


def self_cuts(mesh: Mesh) -> int:
    """Pairs of a mesh's own triangles that pierce each other."""
    return len(self_piercings(mesh.vertices, mesh.triangles))


def cuts(head: Head, pairs=APART) -> dict[tuple[str, str], int]:
    """Pair of parts -> pairs of triangles that pierce each other, where there are any."""
    found = {
        (a, b): len(_between(head.parts[a], _in_mouth(b, head.parts[b]) if a == "skin" else head.parts[b]))
        for a, b in pairs
    }
    return {pair: count for pair, count in found.items() if count}


def smooth_skin(skin: Mesh, levels: int = LEVELS) -> Mesh:
    """The skin as it is drawn: subdivided, its vertices on the limit surface, the cage's own first."""
    operator, quads = smoother(skin.faces, len(skin.vertices), levels)
    return Mesh(operator @ skin.vertices, quads)


def smooth_cuts(head: Head, smooth: Mesh) -> dict[str, int]:
    """Part -> pairs of its triangles and of the smooth skin's that pierce each other; ``skin`` for the skin itself."""
    found = {part: len(_between(smooth, _in_mouth(part, head.parts[part]))) for skin, part in APART if skin == "skin"}
    found["skin"] = self_cuts(smooth)
    return {part: count for part, count in found.items() if count}


def _between(one: Mesh, other: Mesh):
    return piercings(one.vertices, one.triangles, other.vertices, other.triangles)


def _in_mouth(part: str, mesh: Mesh) -> Mesh:
    """What of a part must keep clear of the lining: of teeth the crowns, since gums rest in it and roots go through."""
    if part not in ("teeth_upper", "teeth_lower"):
        return mesh
    crown = np.zeros(len(mesh.vertices), dtype=bool)
    crown[mesh.faces[mesh.material == 0].clip(min=0).ravel()] = True
    crown &= crowns(mesh)
    return replace(mesh, faces=mesh.faces[crown[mesh.faces].all(axis=1) & (mesh.faces[:, 3] >= 0)])
