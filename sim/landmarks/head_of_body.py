# SPDX-License-Identifier: GPL-3.0-or-later
"""The head in a scan of somebody from head to foot: a face is looked for at the ends of the body, one after the other.

Laid on all of a body at once, a face finds hips and knees as good as itself, and what is looked at of each is coarser than
its features.
"""

import numpy as np

from ..anatomy.head import Head
from ..mesh import Mesh, vertex_areas
from ..progress import Progress, Work, portion
from ..scan.face_match import FINE, surface_samples, thinned
from ..scan.units import UNITS, is_body
from .looking import looked
from .looks import ANY_SIZE, PLAIN, WHOLE
from .pose_search import LOOKING
from .shape_space import ShapeSpace
from .verdict import ODD, share_of

ENDS = 8  # of a body that are looked at: head, hands and feet, and what else sticks out
APART = 350.0  # mm between two ends
ROUND = 320.0  # mm around an end, the top of a head or a hand, that are looked at: a head is 250 high
HEAD = 350.0  # mm around the middle of a face that are kept: all of the head, and shoulders
FEW = 300  # triangles: an end with fewer is a speck
#: Area of the surface against the square of its width, above which nothing is a body: people of 1.75 m and 75 kg have 1.9 m² of
#: skin (Du Bois and Du Bois 1916), .6.
THIN = 0.8


def body_scales(mesh: Mesh) -> list[float]:
    """mm per unit, the usual ones in which the mesh may be somebody from head to foot; none if it is too bulky for that."""
    width = 2 * _away(thinned(surface_samples(mesh), FINE)).max()
    if vertex_areas(mesh.vertices, mesh.triangles).sum() > THIN * width**2:
        return []
    return [scale for scale in UNITS.values() if is_body(_extent(mesh) * scale)]


def head_of_body(mesh: Mesh, reference: Head, space: ShapeSpace, template, scales) -> Work:
    """Work returning the part of ``mesh`` around the face at the first end of a body that shows one plainly, and mm per unit;
    None: none does.

    template (k, 3) mm : as of `face_template`; scales : mm per unit, of which those are tried that make it a body
    """
    scales = [scale for scale in scales if is_body(_extent(mesh) * scale)]
    for k, scale in enumerate(scales):
        places = ends(surface_samples(mesh) * scale)
        for j, place in enumerate(places):
            low, high = ((k + (j + more) / len(places)) / len(scales) for more in (0, 1))
            yield Progress(low, LOOKING)
            part = around(mesh, place / scale, ROUND / scale)
            if len(part.faces) < FEW:
                continue
            seen = yield from portion(looked(ANY_SIZE, part, reference, space, template, [scale], 0.7), low, high)
            seen = [result for result in seen if _is_plain(result)]
            if seen:
                _, _, fit, _, of = min(seen, key=lambda t: t[0])
                return around(mesh, fit.points[of.face > 0.5].mean(axis=0) / scale, HEAD / scale), scale
    return None


def _is_plain(result) -> bool:
    """Whether ``result``, one of those of `looked`, is plainly a whole face."""
    verdict, _, fit, _, space = result
    whole = share_of(space, fit) > WHOLE
    return not verdict.doubtful and verdict.likeness > PLAIN and verdict.bad < ODD and whole


def ends(points) -> np.ndarray:
    """(k, 3) mm, k up to `ENDS`: those of ``points`` (n, 3) that are farthest from their middle and `APART` from each other,
    the farthest first."""
    points = thinned(points, FINE)  # as dense in the face as elsewhere
    away = _away(points)
    out = []
    while len(out) < ENDS and away.max() > 0:
        place = points[away.argmax()]
        out.append(place)
        away[np.linalg.norm(points - place, axis=1) < APART] = 0.0
    return np.array(out).reshape(-1, 3)


def around(mesh: Mesh, place, reach: float) -> Mesh:
    """The triangles of ``mesh`` of which all corners are within ``reach`` of ``place`` (3,)."""
    near = ((mesh.vertices - place) ** 2).sum(axis=1) < reach**2
    triangles = mesh.triangles[near[mesh.triangles].all(axis=1)]
    used, index = np.unique(triangles, return_inverse=True)
    return Mesh.from_triangles(mesh.vertices[used], index.reshape(-1, 3))


def _extent(mesh: Mesh) -> float:
    return float(np.ptp(mesh.vertices, axis=0).max())


def _away(points):
    """(n,) how far ``points`` (n, 3) lie from their middle."""
    return np.linalg.norm(points - points.mean(axis=0), axis=1)
