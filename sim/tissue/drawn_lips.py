# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact of the lips with each other where they are drawn: points of the one against the tangent planes of the other."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..mesh import vertex_normals
from .drawn_samples import Samples, drawn_samples
from .geometry import short_diagonals, unit

#: mm between the points of lips at which what is left of penetration is looked for, and the other lip's that are looked at.
FINE, MANY = 0.5, 6
#: mm beside each other at which points are across from each other, at least; cosine to its normal at rest below which
#: a point's normal tells nothing: the surface is crumpled there.
BESIDE, TURNED = 0.9, 0.0
#: mm from the other lip, at rest, that the surface of a lip is looked at; mm by which a lip is at least thick, and where it
#: joins the other. Two points with flesh between them are apart at rest, by more than this share of their distance, against
#: the way they face.
LIP_DEEP, LIP_THIN, CORNER_THIN, BACK_TO_BACK = 7.0, 1.0, 0.3, 0.6
#: mm within which two points of the lips may touch, and the gap that is kept between them at most.
LIP_REACH, LIP_GAP = 3.0, 0.25


@dataclass(frozen=True, eq=False)
class Lips:
    """points on the upper and on the lower lip; mm ``beside`` each other at which two are still across from each other; their
    places and normals at rest; ``mates``: how many of the other lip's points are looked at for each; least mm (at most 0)
    that each is before the other lip at rest; joins: bool, the lip goes over into the other one there."""

    points: tuple[Samples, Samples]
    beside: float
    mates: int
    rest: tuple[np.ndarray, np.ndarray]
    normals: tuple[np.ndarray, np.ndarray]
    least: tuple[np.ndarray, np.ndarray]
    joins: tuple[np.ndarray, np.ndarray]


def build_lips(faces, skin, weights, free, spacing, mates) -> Lips:
    """The `Lips` of vertices whose ``weights``, (n,) of the upper and of the lower lip, are more than 0.3 and that are
    ``free`` (n,)."""
    points = []
    for own, other in (weights, weights[::-1]):
        found = drawn_samples(faces, skin, (own > 0.3) & free, spacing, fans=mates > 1)
        points.append(found[found.rows @ own > found.rows @ other])  # at the corner of the mouth both lips have a share
    if all(len(x) for x in points):  # what lies on the far side of a lip never meets the other one
        places = [x.at(skin) for x in points]
        far = [cKDTree(places[1 - k]).query(places[k])[0] < LIP_DEEP for k in (0, 1)]
        points = [x[f] for x, f in zip(points, far, strict=True)]
    normals = vertex_normals(skin, short_diagonals(skin, faces))
    least = tuple(np.zeros(len(x)) for x in points)
    joins = tuple(x.rows @ other > 0.02 for x, other in zip(points, weights[::-1], strict=True))
    flat = [unit(x.at(normals)) for x in points]
    lips = Lips(tuple(points), max(spacing, BESIDE), mates, *_lips_at(points, skin, normals, flat), least, joins)
    for own, _, which, _, _, gap in _across(lips, lips.rest, lips.normals, 0.0, LIP_REACH):
        least[own][which] = gap
    return lips


def lip_contacts(lips: Lips, skin, normals, most: float = LIP_GAP, reach: float = LIP_REACH):
    """Each point of a lip against the tangent plane of the nearest point of the other that is across from it, ``most`` mm
    before it at most; pieces for `planes_of`."""
    out = []
    for own, other, which, mate, facing, gap in _across(
        lips, *_lips_at(lips.points, skin, normals, lips.normals), most, reach
    ):
        both = lips.points[own].along(which, facing), lips.points[other].along(mate, -facing)
        column, value = (np.concatenate(pair, axis=1) for pair in zip(*both, strict=True))
        out.append((column, value, np.maximum(gap, lips.least[own][which])))
    return out


def _across(lips: Lips, places, normals, most, reach):
    """For both lips: its index and the other's, points (c,), those of the other lip across from them (c,), the directions
    (c, 3) from these to those, and the mm (c,) that they keep."""
    if min(len(x) for x in lips.points) < 3:
        return
    told = [n.any(axis=1) for n in normals]
    for own, other in ((0, 1), (1, 0)):
        near = range(1, 1 + lips.mates)
        distance, mate = cKDTree(places[other]).query(places[own], near, distance_upper_bound=reach)
        which, place = np.nonzero(np.isfinite(distance))
        distance, mate = distance[which, place], mate[which, place]
        facing = normals[other][mate] - normals[own][which]
        size = np.einsum("ij,ij->i", facing, facing)
        facing = unit(facing)
        away = places[own][which] - places[other][mate]
        beside = distance**2 - np.einsum("ij,ij->i", away, facing) ** 2
        before = unit(lips.normals[other][mate] - lips.normals[own][which])
        apart = lips.rest[own][which] - lips.rest[other][mate]
        gap = np.einsum("ij,ij->i", apart, before)
        thin = np.maximum(LIP_THIN, BACK_TO_BACK * np.sqrt(np.einsum("ij,ij->i", apart, apart)))
        through = gap < -np.where(lips.joins[own][which] | lips.joins[other][mate], CORNER_THIN, thin)
        # more than 60 degrees between their normals, across from each other, and no flesh between them: round the corner of
        # the mouth two points may be back to back
        both = told[own][which] & told[other][mate]
        ok = np.flatnonzero(both & (size > 1.0) & (beside < lips.beside**2) & ~through)
        ok = ok[np.unique(which[ok], return_index=True)[1]]  # the nearest of each
        yield own, other, which[ok], mate[ok], facing[ok], np.minimum(gap[ok], most)


def _lips_at(points, skin, normals, rest):
    """Where both lips' ``points`` are and their normals: those of what is drawn if their fans are known, else between the
    vertices' ``normals`` (n, 3); 0 where a crumpled surface has turned against its normals at ``rest``."""
    places, out = [x.at(skin) for x in points], []
    for x, at, before in zip(points, places, rest, strict=True):
        if x.fan is None:
            out.append(unit(x.at(normals)))
        else:
            drawn = x.fan.normals(at, skin)
            out.append(np.where(np.einsum("ij,ij->i", drawn, before)[:, None] > TURNED, drawn, 0))
    return places, out
