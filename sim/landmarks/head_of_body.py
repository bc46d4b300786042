# SPDX-License-Identifier: GPL-3.0-or-later
"""The head in a scan of more than a bust: of somebody from head to foot, or among walls and furniture.

Laid on all of that at once, a face finds hips, knees and cushions as good as itself, and what is looked at of each is coarser
than its features. So it is looked for in one part after the other: what sticks out of a body, and what is left without walls.
"""

import numpy as np

from ..anatomy.head import Head
from ..mesh import Mesh, vertex_areas
from ..progress import Progress, Work, portion
from ..scan.face_match import FINE, surface_samples, thinned
from ..scan.scenery import in_walls, only, pieces, without
from ..scan.units import PLAUSIBLE, USUAL, is_body, is_scene
from .looking import looked
from .looks import ANY_SIZE, PLAIN, WHOLE
from .pose_search import LOOKING
from .shape_space import ShapeSpace
from .verdict import ODD, share_of

ENDS = 8  # of a body that are looked at: head, hands and feet, and what else sticks out
PIECES, PARTS = 7, 16  # that a scan falls into, and parts of these, that are looked at
APART = 350.0  # mm between two ends
ROUND = 320.0  # mm around an end, the top of a head or a hand, that are looked at: a head is 250 high
HEAD = 350.0  # mm around the middle of a face that are kept: all of the head, and shoulders
FEW = 300  # triangles: an end with fewer is a speck
PATCH = 5000.0  # mm²: a piece with less is a shred, as of the edges of a board, and no face: a third of one has 8,000
#: Area of the surface against the square of its width, above which nothing is a body: people of 1.75 m and 75 kg have 1.9 m² of
#: skin (Du Bois and Du Bois 1916), .6.
THIN = 0.8
#: mm across, as which bodies in no usual unit are looked at: from head to foot, and from the head to the hips.
STATURES = (1750.0, 1100.0)
#: Of samples of a head, a face or a bust the least spread against the greatest; people's bodies have less than half of it.
BULKY = 0.4
#: Share of the area that is walls in a room. A head as large as a person is .05 to .56 of that where it is smooth.
WALLED = 0.6
SIMILAR = 1.2  # between two scales that are as good as one: a face is found if it is .72 to 1.22 of the reference


def body_scales(mesh: Mesh, usual=USUAL) -> list[float]:
    """mm per unit, the ``usual`` ones in which the mesh may be somebody from head to foot; none if it is too bulky for that."""
    return [scale for scale in usual if is_body(_extent(mesh) * scale)] if _is_thin(mesh) else []


def other_scales(mesh: Mesh, known, usual=USUAL) -> list[float]:
    """mm per unit, beside those that are ``known``, of what is rarer than `body_scales`: the ``usual`` ones in which it is a
    room or has walls, and those that make a body of no usual unit as large as people are."""
    scales = [scale for scale in usual if is_scene(_extent(mesh) * scale)]
    scales = [scale for scale in scales if in_walls(mesh, scale).any()]
    if _is_thin(mesh):
        scales += [stature / _extent(mesh) for stature in STATURES]
    return [scale for scale in scales if all(not 1 / SIMILAR < scale / other < SIMILAR for other in known)]


def may_be_bust(mesh: Mesh, scales) -> bool:
    """Whether the mesh may be a mere head or bust, in no usual unit, although it is more in all ``scales``, mm per unit: it is
    as bulky as those are, and not most of it is walls."""
    if not scales or not all(is_scene(_extent(mesh) * scale) for scale in scales):
        return False
    points = surface_samples(mesh)
    spread = np.sqrt(np.linalg.eigvalsh(np.cov((points - points.mean(axis=0)).T)))
    if spread[0] < BULKY * spread[2]:
        return False
    return all(_area(without(mesh, ~in_walls(mesh, scale))) < WALLED * _area(mesh) for scale in scales)


def is_bust(mesh: Mesh, scale: float) -> bool:
    """Whether the mesh is no larger than a head or a bust in so many mm per unit."""
    return _extent(mesh) * scale <= PLAUSIBLE[1]


def head_of_body(mesh: Mesh, reference: Head, space: ShapeSpace, template, scales) -> Work:
    """Work returning the first part of ``mesh`` that shows a face plainly: what `looked` says of that, and all around the face
    that the part was cut from; None: none does.

    template (k, 3) mm : as of `face_template`; scales : mm per unit, of which those are tried that make it more than a bust
    """
    scales = [scale for scale in scales if is_scene(_extent(mesh) * scale)]
    for k, scale in enumerate(scales):
        yield Progress(k / len(scales), LOOKING)
        parts = parts_of(mesh, scale)
        for j, (piece, part) in enumerate(parts):
            low, high = ((k + (j + more) / len(parts)) / len(scales) for more in (0, 1))
            seen = yield from portion(looked(ANY_SIZE, part, reference, space, template, [scale], 0.7), low, high)
            seen = [result for result in seen if _is_plain(result)]
            if seen:
                best = min(seen, key=lambda t: t[0])
                _, _, fit, _, of = best
                return best, around(piece, fit.points[of.face > 0.5].mean(axis=0) / scale, HEAD / scale)
    return None


def parts_of(mesh: Mesh, scale: float) -> list[tuple[Mesh, Mesh]]:
    """Parts of ``mesh``, with so many mm per unit, in which a head may be, likeliest first, after what each is a part of.

    These are the pieces that it falls into without walls, as they are, where they are of the size of a head or a bust, and of
    those that are larger the ends, one of each piece after the other; at last those of all of it, which may be in shreds.
    """
    rest, ranked = without(mesh, in_walls(mesh, scale)), []
    apart = pieces(rest, FEW)[:PIECES]
    for k, piece in enumerate([*apart, rest] if len(apart) > 1 else apart):
        across = _extent(piece) * scale
        if is_body(across):
            places = ends(surface_samples(piece) * scale) / scale
            ranked += [(j, k, piece, around(piece, place, ROUND / scale)) for j, place in enumerate(places)]
        elif PLAUSIBLE[0] <= across <= PLAUSIBLE[1] and _area(piece) * scale**2 > PATCH:
            ranked.append((0, k, piece, piece))
    ranked.sort(key=lambda t: t[:2])
    return [(piece, part) for *_, piece, part in ranked if len(part.faces) >= FEW][:PARTS]


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
    return only(mesh, triangles)


def _is_thin(mesh: Mesh) -> bool:
    """Whether the mesh is not too bulky for somebody's body."""
    width = 2 * _away(thinned(surface_samples(mesh), FINE)).max()
    return _area(mesh) <= THIN * width**2


def _area(mesh: Mesh) -> float:
    return float(vertex_areas(mesh.vertices, mesh.triangles).sum())


def _extent(mesh: Mesh) -> float:
    return float(np.ptp(mesh.vertices, axis=0).max())


def _away(points):
    """(n,) how far ``points`` (n, 3) lie from their middle."""
    return np.linalg.norm(points - points.mean(axis=0), axis=1)
