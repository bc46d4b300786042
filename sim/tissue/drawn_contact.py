# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact of what is drawn: the limit surface of lips, cheeks' lining and lids with teeth, eyeballs and the other lip.

Each is a point between nodes against a plane (`planes.Planes`, its rows). As with all contacts here, a point that is
nearer than it should be at rest may stay so: the neutral face is exactly the scan.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from ..anatomy.head import Head
from ..mesh import vertex_normals
from .arch import Arch, wall_planes
from .drawn_samples import SPACING, Samples, drawn_samples, planes_of
from .eye_surface import eyeball_radius
from .flesh import Flesh, build_flesh
from .geometry import short_diagonals
from .gingiva import attached
from .planes import Planes
from .solids import Solid, build_solid
from .structures import Layers, Lids

#: mm that is kept from teeth and eyeball where there is that much at rest; mm within which there is contact.
CLEAR, REACH = 0.15, 1.2
#: mm between points of cheeks, lining and lids; skin that far from an eyeball may come to lie on it as the lid is drawn out.
WIDE, DRAPED = 2.4, 5.0
#: mm between the points of lips at which what is left of penetration is looked for.
FINE = 0.8
#: rad from the front, seen from the axis of a row of teeth, within which there are teeth.
BESIDE = 1.6
#: mm from the other lip, at rest, that the surface of a lip is looked at, and by which a lip is at
#: least thick.
LIP_DEEP, LIP_THIN = 7.0, 1.0
#: mm within which two points of the lips may touch, and the gap that is kept between them at most.
LIP_REACH, LIP_GAP = 3.0, 0.25


@dataclass(frozen=True, eq=False)
class Before:
    """Points that stay in front of something rigid by ``clearance`` (k,) mm; ``of`` is an `Arch` or one eye's `Lids`."""

    of: Any
    points: Samples
    clearance: np.ndarray


@dataclass(frozen=True, eq=False)
class Lips:
    """points on the upper and on the lower lip, ``spacing`` mm apart; their places and normals at rest; least mm (at most
    0) that they are apart there."""

    points: tuple[Samples, Samples]
    spacing: float
    rest: tuple[np.ndarray, np.ndarray]
    normals: tuple[np.ndarray, np.ndarray]
    least: float


@dataclass(frozen=True, eq=False)
class Within:
    """A `Solid`, its ``points`` (k, `Samples` of the skin or columns of fascia) that stay out of it, and the mm (k,) in
    front of it, at most 0, that they keep because they are no farther at rest."""

    solid: Solid
    points: Any
    kept: np.ndarray


def _within(mesh, lower, points, places, spacing) -> Within:
    solid = build_solid(mesh, lower, places, spacing)
    kept = np.zeros(len(places))
    rows, _, height, _ = solid.planes(places, np.eye(3), np.zeros(3))
    kept[rows] = np.minimum(height, 0)
    return Within(solid, points, kept)


@dataclass(frozen=True, eq=False)
class DrawnSurfaces:
    """teeth, eyes: what may touch them; lips: the two, fine_lips: the same more closely; flesh: both faces of lips and cheeks;
    rigid: part -> mesh of what is solid; nodes (3 n, 3) mm at rest; fascia: bone -> columns over
    it."""

    teeth: tuple[Before, ...]
    eyes: tuple[Before, ...]
    lips: Lips
    fine_lips: Lips
    flesh: Flesh
    rigid: dict
    nodes: np.ndarray
    fascia: dict

    @cached_property
    def rows_of_teeth(self) -> tuple[Within, ...]:
        """Both rows of teeth with their gums as solids, made when they are first asked for."""
        rest = self.nodes[: len(self.nodes) // 3]
        out = []
        for before in self.teeth:
            # behind the last tooth the lining has grown round the end of the gum
            points = before.points[np.abs(before.of.coordinates(before.points.at(rest))[0]) < BESIDE]
            part = "teeth_lower" if before.of.lower else "teeth_upper"
            if len(points):
                out.append(_within(self.rigid[part], before.of.lower, points, points.at(rest), 0.5))
        return tuple(out)

    @cached_property
    def bones(self) -> tuple[Within, ...]:
        """Skull and mandible as solids, for the fascia that stands on each."""
        n = len(self.nodes) // 3
        return tuple(
            _within(self.rigid[name], name == "mandible", column, self.nodes[n + column], 1.0)
            for name, column in self.fascia.items()
        )


def build_drawn(head: Head, layers: Layers, arches: tuple[Arch, ...], lids_of_both: tuple[Lids, ...]) -> DrawnSurfaces:
    """The points of ``head`` at which contact is looked for; only columns that are free to move have any."""
    skin, faces = head.skin.vertices, head.skin.faces
    n = len(skin)
    free = layers.free[:n]
    group = {k: np.asarray(head.groups.get(k, np.zeros(n)), float) for k in ("lip_upper", "lip_lower", "mouth_bag")}
    mouth = (np.max(list(group.values()), axis=0) > 0.05) & free
    lining = drawn_samples(faces, skin, mouth, WIDE)
    points = lining.at(skin)
    held = lining.rows @ attached(head)[0]
    teeth = []
    for arch in arches:
        far, wall = arch.before(points)
        # at any height: what stands in front of the row where it is highest is in front of it
        ahead = arch.crest(points)
        ahead = (ahead > 0.6 * arch.radius.max()) & (far > ahead - 1.5) & (held < 0.3)
        gap = np.where(wall > 0, far - wall, np.inf)
        teeth.append(Before(arch, lining[ahead], np.minimum(gap[ahead], CLEAR)))
    eyes = []
    for lids in lids_of_both:
        near = np.zeros(n, bool)
        near[lids.contact_column] = True
        near &= np.linalg.norm(skin - lids.eye.centre, axis=1) < lids.eye.radius + DRAPED
        seen = drawn_samples(faces, skin, near & free, WIDE)
        at = seen.at(skin)
        gap = np.linalg.norm(at - lids.eye.centre, axis=1) - eyeball_radius(lids, at, np.zeros(2))
        eyes.append(Before(lids, seen, np.minimum(gap, CLEAR)))
    rigid = {k: head.parts[k] for k in ("teeth_upper", "teeth_lower", "skull", "mandible") if k in head.parts}
    on_bone = layers.bony & free
    over = {"skull": layers.mandible <= 0.5, "mandible": layers.mandible > 0.5}
    fascia = {k: np.flatnonzero(on_bone & over[k]) for k in over if k in rigid and (on_bone & over[k]).any()}
    lips = [(group[k] > 0.3) & free for k in ("lip_upper", "lip_lower")]
    lips = [_lips(faces, skin, lips, spacing) for spacing in (SPACING, FINE)]
    inside = np.asarray(head.groups.get("inner", np.zeros(n))) > 0.5
    flesh = build_flesh(faces, skin, mouth, inside)
    return DrawnSurfaces(tuple(teeth), tuple(eyes), *lips, flesh, rigid, layers.nodes, fascia)


def _lips(faces, skin, groups, spacing) -> Lips:
    points = [drawn_samples(faces, skin, group, spacing) for group in groups]
    if all(len(x) for x in points):  # what lies on the far side of a lip never meets the other one
        places = [x.at(skin) for x in points]
        far = [cKDTree(places[1 - k]).query(places[k])[0] < LIP_DEEP for k in (0, 1)]
        points = [x[f] for x, f in zip(points, far, strict=True)]
    normals = vertex_normals(skin, short_diagonals(skin, faces))
    lips = Lips(tuple(points), spacing, *_lips_at(points, skin, normals), 0.0)
    gaps = [gap for *_, gap in _across(lips, lips.rest, lips.normals, 0.0, LIP_REACH)]
    return replace(lips, least=min((float(gap.min(initial=0.0)) for gap in gaps), default=0.0))


def drawn_contacts(surfaces: DrawnSurfaces, skin, normals, rotation, translation, gaze_of) -> Planes:
    """All that the drawn surface of ``skin`` (n, 3) touches; normals (n, 3) of the cage."""
    return planes_of(
        [
            *(eye_contacts(before, skin, gaze_of(before.of.side)) for before in surfaces.eyes),
            *(tooth_contacts(before, skin, rotation, translation) for before in surfaces.teeth),
            *lip_contacts(surfaces.lips, skin, normals),
        ],
        len(skin),
    )


def eye_contacts(before: Before, skin, gaze, most: float = CLEAR):
    """Lids against the eyeball with its cornea, turned by ``gaze`` (2,) rad, clear of it by ``most`` mm at most; a piece
    for `planes_of`."""
    lids = before.of
    rel = before.points.at(skin) - lids.eye.centre
    size = np.maximum(np.linalg.norm(rel, axis=1), 1e-9)
    near = np.flatnonzero(size < lids.profile.max() + CLEAR + REACH)
    need = eyeball_radius(lids, rel[near] + lids.eye.centre, gaze) + np.minimum(before.clearance[near], most)
    close = size[near] < need + REACH
    near, need = near[close], need[close]
    normal = rel[near] / size[near, None]
    return *before.points.along(near, normal), normal @ lids.eye.centre + need


def on_the_ball(before: Before, skin, gaze, rounds: int = 6) -> np.ndarray:
    """(v, 3) mm: the lids' vertices of ``skin`` (n, 3) pushed out until what is drawn of them lies on the eyeball: where
    lids are to go, so that they need not be held off it."""
    lids, rows = before.of, before.points.rows
    out = skin.copy()
    for _ in range(rounds):
        rel = rows @ out - lids.eye.centre
        size = np.maximum(np.linalg.norm(rel, axis=1), 1e-9)
        deep = eyeball_radius(lids, rel + lids.eye.centre, gaze) + before.clearance - size
        hit = np.maximum(deep, 0)
        if hit.max(initial=0.0) < 0.02:
            break
        share = (rows.T @ np.column_stack([(hit / size)[:, None] * rel, hit > 0]))[lids.column]
        out[lids.column] += 1.5 * share[:, :3] / np.maximum(share[:, 3:], 0.05)
    return out[lids.column]


def tooth_contacts(before: Before, skin, rotation, translation):
    """Lips and cheeks in front of a row of teeth; a piece for `planes_of`."""
    points = before.points.at(skin)
    keep, normal, missing = wall_planes(before.of, points, before.clearance, rotation, translation, REACH)
    level = np.einsum("ij,ij->i", points[keep], normal) + missing
    return *before.points.along(keep, normal), level


def lip_contacts(lips: Lips, skin, normals, most: float = LIP_GAP, reach: float = LIP_REACH):
    """Each point of a lip against the tangent plane of the nearest point of the other, ``most`` mm before it at most; pieces
    for `planes_of`."""
    out = []
    for own, other, which, mate, facing, gap in _across(lips, *_lips_at(lips.points, skin, normals), most, reach):
        both = lips.points[own].along(which, facing), lips.points[other].along(mate, -facing)
        column, value = (np.concatenate(pair, axis=1) for pair in zip(*both, strict=True))
        out.append((column, value, np.maximum(gap, lips.least)))
    return out


def _across(lips: Lips, places, normals, most, reach):
    """For both lips: its index and the other's, points (c,), those of the other lip across from them (c,), the directions
    (c, 3) from these to those, and the mm (c,) that they keep."""
    if min(len(x) for x in lips.points) < 3:
        return
    for own, other in ((0, 1), (1, 0)):
        distance, near = cKDTree(places[other]).query(places[own], distance_upper_bound=reach)
        which = np.flatnonzero(np.isfinite(distance))
        mate = near[which]
        facing = normals[other][mate] - normals[own][which]
        size = np.einsum("ij,ij->i", facing, facing)
        facing = _unit(facing)
        away = places[own][which] - places[other][mate]
        beside = distance[which] ** 2 - np.einsum("ij,ij->i", away, facing) ** 2
        before = _unit(lips.normals[other][mate] - lips.normals[own][which])
        gap = np.einsum("ij,ij->i", lips.rest[own][which] - lips.rest[other][mate], before)
        # more than 60 degrees between their normals, across from each other, and no flesh between them: round the corner of
        # the mouth two points may be back to back
        ok = (size > 1.0) & (beside < lips.spacing**2) & (gap > -LIP_THIN)
        yield own, other, which[ok], mate[ok], facing[ok], np.minimum(gap[ok], most)


def _lips_at(points, skin, normals):
    return [x.at(skin) for x in points], [_unit(x.at(normals)) for x in points]


def _unit(vectors):
    return vectors / np.maximum(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)), 1e-9)[:, None]
